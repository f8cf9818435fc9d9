"""Gap reduction: held-out residual and open-loop replay, before and after the causes are added."""
