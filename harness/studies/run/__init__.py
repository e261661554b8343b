"""One scene, or one FMU, run; and the main job, every published scene."""
