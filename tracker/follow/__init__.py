"""Dots from frame to frame.

In: a picture (uint8), its time (s), and the state of all that is known. Out: what was read of every marker, positions
in px (y down), covariances in px², and why a marker was not read. ``frame_step`` is one frame: ``motion_model``,
``reading``, ``judgement``, ``learning``, compiled, on ``state``; ``redetect`` looks for what failed the test of
:mod:`tracker.innovation`; ``rotation_axis`` learns about what a stick turns, ``camera_state`` where the picture went;
``marker`` is a dot as following begins, ``followed_dots`` those of a stick or of two, and ``follower`` goes through a
film with two sticks of any kinds.

What half and twice the constants do is measured by ``benchmarks/tracking/constants.py``.
"""
