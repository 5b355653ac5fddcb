"""Checks of ``torsight doctor``: the film, the log, the actuator, and all of them together, each giving findings."""
