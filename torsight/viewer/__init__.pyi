# The names of torsight.viewer for editors and type checkers; they are imported on first use.

from torsight.viewer.recording import write_recording as write_recording
from torsight.viewer.screenshots import save_pictures as save_pictures
