"""Widths and margins of the search over models."""

import dataclasses as dc


@dc.dataclass(frozen=True)
class SearchOptions:
    """Widths of the search, and margins by which models are kept.

    Source: own choice, where a field names none. Margins are differences of log evidence.
    """

    # Noise.
    temperature: float = 2.0  # factor on the variance of the noise, which is never quite its model [1]
    linear_error: float = 0.03  # share that linear columns get wrong of what they explain [1]
    force_lever: float = 0.05  # at which a force acts that is known as well as the attitude is [m]
    early_command: float = (
        3.0  # deviations ahead of its row, beyond which a command is not held from it; inf: never asked [1]
    )
    # Beam search.
    beam: int = 6  # sets kept from step to step [1]
    beam_margin: float = 8.0  # below the best at which the beam stops growing
    most_effects: int = 8  # in a model [1]
    # Ranking.
    refined: int = 3  # models refined, with what is simpler than these [1]
    refined_margin: float = 12.0  # below the best at which a model is not refined
    faint: float = 0.1  # whitened size over that of all, below which a model is tried without an effect [1]
    # Change points.
    onset_gain: float = 1.0  # prior included, from which an onset is tried
    payload_onset_gain: float = 8.0  # from which a payload that begins in flight is looked for
    onset_columns: int = 8  # most columns of a candidate that is scanned [1]
    onset_variants: int = 2  # variants of an effect that are scanned [1]
    onset_edge: float = 0.7  # from either end of a flight, without onsets [s]
    onset_span: float = 0.4  # that holds an onset as likely as possible [s]
    # Payloads.
    payload_lengths: tuple[float, float, int] = (0.15, 2.5, 96)  # shortest, longest [m], number: 3 % apart
    payloads_kept: int = 3  # candidates of the search [1]
    payloads_followed: int = 2  # lengths followed from each profile [1]
    payload_gain: float = 8.0  # that a length must add to everything else to be followed
    payload_lost: float = -400.0  # below which a guess that is followed is given up
    payload_distinct: int = 12  # number of lengths that can be told apart, for the prior of one [1]
    payload_near: float = 0.06  # relative difference below which lengths are the same [1]
