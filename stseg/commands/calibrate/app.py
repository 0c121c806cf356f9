"""`stseg calibrate`: make a rig file, or check one."""

from cyclopts import App

from stseg.commands.calibrate.align import align
from stseg.commands.calibrate.auto import calibrate_auto
from stseg.commands.calibrate.check import check
from stseg.commands.calibrate.importing import import_calibration
from stseg.commands.calibrate.lens import calibrate_lens
from stseg.commands.calibrate.page import calibrate_page
from stseg.commands.calibrate.points import calibrate_points

app = App(name="calibrate", help="Make a rig file, or check one.")
app.command(calibrate_lens, name="lens")
app.command(calibrate_page, name="page")
app.command(calibrate_points, name="points")
app.command(import_calibration, name="import")
app.command(calibrate_auto, name="auto")
app.command(align, name="align")
app.command(check, name="check")
