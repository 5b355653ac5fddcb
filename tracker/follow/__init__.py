"""Tracking of dots from frame to frame.

In: a picture (uint8), its time (s), and the state. Out: a reading of every marker, with position in px (y down) and
covariance in px², or the reason why there is none. ``frame_step`` processes one frame: ``motion_model``, ``reading``,
``judgement``, ``learning``, compiled, on ``state``; ``redetect`` searches for sticks that failed the test of
:mod:`tracker.innovation`; ``rotation_axis`` estimates a stick's axis, ``camera_state`` the picture's shift and roll;
``marker`` is the initial record of a dot, ``followed_dots`` those of one or two sticks, and ``follower`` goes through a
film with two sticks of any kinds.

The effect of halving and doubling the constants is measured by ``benchmarks/tracking/constants.py``.
"""
