"""Detection of timed events in an angle and in a log, each on its own clock.

In: angles (rad) on the film's clock, temperatures (°C) on the log's. Out: strokes of the actuator with the instants
(s, with sigma) at which they pass given angles, heating segments of both springs, and changepoints: instants at which a
rate jumps, with the lag (s) of the sensor that rounds them; changes of a heating switch.
"""
