# The names of torsight.synthetic for editors and type checkers; they are imported on first use.

from torsight.synthetic.experiment import Record as Record
from torsight.synthetic.experiment import make_record as make_record
from torsight.synthetic.scene import Scene as Scene
from torsight.synthetic.scene import demo_scene as demo_scene
from torsight.synthetic.scene import read_scene as read_scene
from torsight.synthetic.scene import scene_from as scene_from
from torsight.synthetic.scene_files import render_scene as render_scene
