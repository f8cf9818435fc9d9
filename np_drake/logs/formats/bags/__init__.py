"""Storages of ROS bags: the topics of a file, and its messages, within the budgets of the bag."""
