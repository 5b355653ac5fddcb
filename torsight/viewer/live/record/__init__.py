"""Files of a live record.

In: angles, markers and log rows one by one. Out: the tables of ``torsight track`` on disk, whole lines at least twice a
second, ``track.json``, ``live.json``, and the state of the record in words.
"""
