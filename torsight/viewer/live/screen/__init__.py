"""From the measurement to the viewer, without either waiting for the other.

In: pictures and curves. Out: entries of a Rerun recording, the oldest left out where the viewer is slow, and how late
they are shown (s).
"""
