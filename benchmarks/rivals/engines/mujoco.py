"""MuJoCo: dry friction of the last joint (frictionloss); a second inertia is a child of the first.

With rewrite=1 frictionloss, which is one constant force, is written before each step: hold at rest, slide otherwise.
"""

import mujoco
import numpy as np

from ..scenes import NotOfferedError, Scene, Setting, Solution

BODY = """<body><inertial pos="0 0 0" mass="{inertia}" diaginertia="{inertia} {inertia} {inertia}"/>
  <joint type="{kind}" axis="1 0 0" {friction}/>{child}</body>"""
REST = 1e-9  # m/s or rad/s: a slower slip is at rest


def simulate(scene: Scene, setting: Setting) -> Solution:
    """Simulate a scene; `setting` holds attributes of <option>, solreffriction of the joint, and rewrite."""
    options, friction = dict(setting), f'frictionloss="{scene.hold(0.0)}"'
    rewrites, moves = options.pop("rewrite", 0), scene.has_second_inertia
    if not (scene.has_one_coefficient or rewrites):
        raise NotOfferedError("frictionloss is one constant force")
    if "solreffriction" in options:
        friction += f' solreffriction="{options.pop("solreffriction")}"'
    kind, child = "hinge" if scene.is_rotation else "slide", ""
    if moves:
        child = BODY.format(inertia=scene.partner, kind=kind, friction=friction, child="")
    body = BODY.format(inertia=scene.inertia, kind=kind, friction="" if moves else friction, child=child)
    attributes = " ".join(f'{name}="{value}"' for name, value in options.items())
    text = f'<mujoco><option gravity="0 0 0" {attributes}/><worldbody>{body}</worldbody></mujoco>'
    model = mujoco.MjModel.from_xml_string(text)
    data, h = mujoco.MjData(model), model.opt.timestep
    x, v, w = scene.start
    data.qpos[0] = x
    data.qvel[:] = (v, w - v) if moves else v - w  # relative to the belt
    rows = [(0.0, x, v, w)]
    for i in range(round(scene.stop / h)):
        t, slip = i * h, abs(data.qvel[-1])
        if rewrites:
            model.dof_frictionloss[-1] = scene.slide(t, slip) if slip > REST else scene.hold(t)
        data.qfrc_applied[0] = scene.load(t, rows[-1][1])
        mujoco.mj_step(model, data)
        t += h
        if moves:
            rows.append((t, data.qpos[0], data.qvel[0], data.qvel[0] + data.qvel[1]))
        else:
            rows.append((t, data.qpos[0] + w * t, data.qvel[0] + w, w))
    table = np.array(rows)
    return Solution(table[:, 0], table[:, 1:], steps=len(rows) - 1)
