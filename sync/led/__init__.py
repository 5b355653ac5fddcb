"""The times at which an LED on the film is switched on and off.

In: a film and a position in its picture (px), or a file of times. Out: :class:`~sync.led.led_events.LightEvents`,
changes on the film's clock (s) with their direction.
"""
