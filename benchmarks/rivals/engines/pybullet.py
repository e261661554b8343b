"""PyBullet: friction is a motor of the last joint with speed 0 and a limited force; a second inertia is a child.

With rewrite=1 the limit, which is one constant force, is written before each step: hold at rest, slide otherwise.
"""

import numpy as np
import pybullet as bullet

from ..scenes import NotOfferedError, Scene, Setting, Solution

REST = 1e-9  # m/s or rad/s: a slower slip is at rest
ZERO = [0.0, 0.0, 0.0]
LISTS = {  # arguments of createMultiBody with one item for each body
    "linkCollisionShapeIndices": -1, "linkVisualShapeIndices": -1, "linkPositions": ZERO,
    "linkOrientations": [*ZERO, 1.0], "linkInertialFramePositions": ZERO,
    "linkInertialFrameOrientations": [*ZERO, 1.0], "linkJointAxis": [1.0, 0.0, 0.0],
}  # fmt: skip


def simulate(scene: Scene, setting: Setting) -> Solution:
    """Simulate a scene; `setting` holds options of setPhysicsEngineParameter, and rewrite."""
    options, moves = dict(setting), scene.has_second_inertia
    rewrites, inertias = options.pop("rewrite", 0), [scene.inertia, scene.partner][: 1 + moves]
    if not (scene.has_one_coefficient or rewrites):
        raise NotOfferedError("the largest force of a motor is one constant")
    bullet.connect(bullet.DIRECT)
    n, kind = len(inertias), bullet.JOINT_REVOLUTE if scene.is_rotation else bullet.JOINT_PRISMATIC
    lists = {name: [item] * n for name, item in LISTS.items()}
    body = bullet.createMultiBody(
        0.0, linkMasses=inertias, linkParentIndices=list(range(n)), linkJointTypes=[kind] * n, **lists
    )
    x, v, w = scene.start
    for i, inertia in enumerate(inertias):
        zero_damping = {"linearDamping": 0.0, "angularDamping": 0.0, "jointDamping": 0.0}
        bullet.changeDynamics(body, i, localInertiaDiagonal=[inertia] * 3, **zero_damping)
        bullet.setJointMotorControl2(body, i, bullet.VELOCITY_CONTROL, force=0.0)
        bullet.resetJointState(body, i, 0.0 if i else x, w - v if i else v if moves else v - w)
    bullet.setPhysicsEngineParameter(**options)
    h, rows, slip = bullet.getPhysicsEngineParameters()["fixedTimeStep"], [(0.0, x, v, w)], abs(v - w)
    for i in range(round(scene.stop / h)):
        t, at_rest = i * h, slip <= REST or not rewrites
        limit = scene.hold(t) if at_rest else scene.slide(t, slip)
        bullet.setJointMotorControl2(body, n - 1, bullet.VELOCITY_CONTROL, targetVelocity=0.0, force=limit)
        bullet.setJointMotorControl2(body, 0, bullet.TORQUE_CONTROL, force=scene.load(t, rows[-1][1]))
        bullet.stepSimulation()
        t, states = t + h, [bullet.getJointState(body, i)[:2] for i in range(n)]
        (x, v), relative = states[0], states[-1][1]
        slip = abs(relative)
        rows.append((t, x, v, v + relative) if moves else (t, x + w * t, v + w, w))
    bullet.disconnect()
    table = np.array(rows)
    return Solution(table[:, 0], table[:, 1:], steps=len(rows) - 1)
