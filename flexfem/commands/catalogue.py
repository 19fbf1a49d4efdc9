"""The commands of flexfem: their groups, the functions that they call, and their purposes.

`flexfem --help` prints this table, and loads no function for it.
"""

from __future__ import annotations

from typing import NamedTuple


class Listed(NamedTuple):
    """A command: the function of `import flexfem` that it calls, and its purpose in one line."""

    function: str
    purpose: str


START = {
    "new": Listed("new_stage", "Write a commented file of a mechanism, or of the paper's stage."),
    "import": Listed("import_drawing", "Recognise bodies and hinges in a drawing."),
    "check": Listed("check", "Validate a file; show its parts and the sources of its numbers."),
    "view": Listed("view", "Draw a mechanism, or what is recognised in a drawing."),
    "live": Listed("serve", "Serve a page that answers while numbers are changed."),
    "catalogue": Listed(
        "catalogue", "List the stacks, materials and hinge shapes that files may name."
    ),
    "summary": Listed("summary", "Stiffness, range, motion by the actuators and first frequency."),
}
STIFFNESS = {
    "stiffness": Listed("stiffness", "Stiffness, stress, range, and response to a load."),
    "forces": Listed("forces", "Forces through hinges and sections, and highest strains."),
    "buckling": Listed("buckling", "Load factors at which a mechanism buckles."),
    "formulas": Listed("hinge_formulas", "Hinge formulas with source, freedoms and range."),
}
COMPARE = {
    "verify": Listed(
        "verification", "Positioning error of the analytic model, by finite elements."
    ),
    "plot": Listed("plot_results", "Draw figures and the report page from stored results."),
    "budget": Listed("budget", "Split the error of the analytic model into named shares."),
    "converge": Listed("converge", "Mesh convergence: observed order, extrapolated value, band."),
}
DRIVE = {
    "drive": Listed("drive", "Motion by the actuators; of a stage, strokes and forces for a pose."),
    "reach": Listed("reach", "Poses that the drive reaches within all limits."),
    "large": Listed("large", "Motion, force and stiffness at large displacements."),
}
EFFECTS = {
    "modes": Listed("modes", "Natural frequencies and modes, with a payload."),
    "drift": Listed("drift", "Displacement and stress per kelvin, and per kelvin per mm."),
    "gravity": Listed("gravity", "Displacement and stress by weight and that of a payload."),
    "life": Listed("life", "Cycles to failure of the hinges, and amplitude for a wanted life."),
}
MEASURE = {
    "compare": Listed("compare", "Mechanisms side by side: changes, judged by the bands."),
    "experiment": Listed(
        "experiment", "Simulate the paper's stiffness experiment, of a stage only."
    ),
    "identify": Listed(
        "identify", "Fit measured slopes by an offset of all necks, of a stage only."
    ),
    "as-built": Listed("as_built", "Stiffness with the measured necks, and its scatter."),
}
DESIGNS = {
    "study": Listed("", "Study many designs: run, count finished designs, collect, plot."),
    "design": Listed("", "Find the dimensions that meet requirements best."),
}
EXPORT = {
    "export": Listed("export", "Write a drawing or a solid for the workshop, in mm."),
    "mesh": Listed("mesh", "Mesh a mechanism and write the mesh with named groups."),
    "report": Listed("report", "Write one HTML page of a file or of stored results."),
    "schema": Listed("schema", "JSON schema of a kind of file, or the table of its keys."),
}
REGRESSION = {
    "regression": Listed("regression", "Compare present results with accepted baselines."),
    "baseline": Listed("baseline", "Accept the present results of files as their baselines."),
}
GROUPS = {
    "Start": START,
    "Stiffness and hinges": STIFFNESS,
    "Compare with finite elements": COMPARE,
    "Drive and reach": DRIVE,
    "Vibration, heat, weight and life": EFFECTS,
    "Measure": MEASURE,
    "Many designs": DESIGNS,
    "Export and report": EXPORT,
    "Regression checks": REGRESSION,
}
COMMANDS = {name: listed for group in GROUPS.values() for name, listed in group.items()}
STUDY = {  # commands of `flexfem study`
    "run": Listed("run_study", "Compute the unfinished designs; also continues a stopped run."),
    "status": Listed("study_status", "Count designs by status, with reasons of refusals."),
    "clean": Listed("clean_study", "Remove parts of other inputs or versions."),
    "collect": Listed("collect_study", "Join the finished designs in one table, in their order."),
    "plot": Listed("plot_study", "Collect the table and draw the figures, as PNG and PDF."),
}
RENAMED = {  # old names of commands, with their replacements
    "solve": "flexfem stiffness --models elements",
    "command": "flexfem drive",
    "workspace": "flexfem large, or flexfem reach for the poses of the drive",
    "claims": "make claims",
    "benchmark": "make validation",
    "cross-check": "make validation",
}
RENAMED_OPTIONS = {  # old options, with their replacements
    "--layers": ("--solid", "--thickness-resolution N"),
}
