"""How the engine decides."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Settings:
    """How the engine decides; the defaults are those that the blind suite was run with.

    Attributes
    ----------
    most_effects : int
        Largest set that is tried.
    beam : int
        Sets per size that are extended.
    most_extensions : int
        Larger sets per size that are fitted, the most promising ones.
    least_held_out_gain : float
        Share of the held-out squared error that an effect must remove.
    rival_gain : float
        Sets within this cost of the best explain the record as well ...
    rival_share : float
        ... and so do those within this share of what the best one leaves beyond the floor.
    share_explained : float
        A set is named where it explains this share of what was to explain ...
    unseen_left : float
        ... and leaves no more than this share of the squared error of the base model on unseen blocks, or little, ...
    near_floor : float
        ... or leaves less than this many times the floor.
    share_of_rest : float
        In a set of several each one must remove this share of what is left beyond the floor without it, on blocks that
        the fit has not seen: a second name is not given for the error of the first one's form.
    share_of_all : float
        For the same reason each one must remove this share of the base model's squared error on such blocks, unless it
        is one of two, less is left with it than is worth a name or than a tenth of what is left without it, it removes
        clearly more than is worth a name, and its values do not hang together with the other's.
    least_size : float
        An effect that takes less than this many of the problem's resolutions (root mean square) from the residual is
        not worth a name, unless it is in plain sight.
    plain_over_floor, plain_share, plain_held_out : float
        An effect is in plain sight where so many times the floor is left without it, it explains this share of that,
        and no more than this share of the score on unseen blocks is left with it.
    least_unknown, over_floor_unknown : float
        Something is missing, named or not, where the residual exceeds so many resolutions and so many times a floor
        that was measured at rests.
    """

    most_effects: int = 3
    beam: int = 3
    most_extensions: int = 12
    least_held_out_gain: float = 0.02
    rival_gain: float = 12.0
    rival_share: float = 0.5
    share_explained: float = 0.8
    unseen_left: float = 0.33
    near_floor: float = 2.0
    share_of_rest: float = 0.6
    share_of_all: float = 0.05
    least_size: float = 2.0
    plain_over_floor: float = 1.6
    plain_share: float = 0.9
    plain_held_out: float = 0.5
    least_unknown: float = 4.5
    over_floor_unknown: float = 3.0
