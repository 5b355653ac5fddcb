"""Mechanisms that compete with the library's effects and are never named: one file each, found by folder.

A record in which something outside the library is at work must not get the name of the effect that happens to come
nearest. So the mechanisms that the literature knows beside the library are tried too. Where one of them explains the
record better than every named effect, the verdict is ``unknown``, the mechanism stands in for what is missing, and its
drivers are told. They are declared as the named ones are (:class:`torsight.actuator.effects.Effect`).
"""
