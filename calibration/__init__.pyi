# The names of calibration for editors and type checkers; they are imported on first use.

from calibration.axis import pose_from_tracks as pose_from_tracks
from calibration.boards.board_file import Board as Board
from calibration.boards.board_file import read_board as read_board
from calibration.boards.printing import draw_board as draw_board
from calibration.boards.printing import usual_board as usual_board
from calibration.boards.printing import write_board as write_board
from calibration.stage import Calibration as Calibration
from calibration.stage import calibrate_one as calibrate_one
from calibration.stage import calibrate_two as calibrate_two
from calibration.stage import camera_of as camera_of
from calibration.stage import measure_axis as measure_axis
