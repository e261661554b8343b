"""DART: Coulomb friction of the last joint; a second inertia is a child of the first.

With rewrite=1 the friction, which is one constant force, is written before each step: hold at rest, slide otherwise.
"""

import numpy as np
from dartpy import dynamics, simulation

from ..scenes import NotOfferedError, Scene, Setting, Solution

REST = 1e-9  # m/s or rad/s: a slower slip is at rest


def simulate(scene: Scene, setting: Setting) -> Solution:
    """Simulate a scene; `setting` holds time_step and rewrite."""
    rewrites, moves = setting.get("rewrite"), scene.has_second_inertia
    if not (scene.has_one_coefficient or rewrites):
        raise NotOfferedError("the Coulomb friction of a joint is one constant force")
    world, skeleton, body = simulation.World(), dynamics.Skeleton(), None
    world.setGravity([0.0, 0.0, 0.0])
    if "time_step" in setting:
        world.setTimeStep(setting["time_step"])
    for inertia in (scene.inertia, scene.partner) if moves else (scene.inertia,):
        if scene.is_rotation:
            joint, body = skeleton.createRevoluteJointAndBodyNodePair(body)
        else:
            joint, body = skeleton.createPrismaticJointAndBodyNodePair(body)
        joint.setAxis([1.0, 0.0, 0.0])
        body.setInertia(dynamics.Inertia(inertia, np.zeros(3), inertia * np.eye(3)))
    joint.setCoulombFriction(0, scene.hold(0.0))
    world.addSkeleton(skeleton)
    x, v, w = scene.start
    skeleton.setPosition(0, x)
    skeleton.setVelocities([v, w - v] if moves else [v - w])  # relative to the belt
    rows, h = [(0.0, x, v, w)], world.getTimeStep()
    for i in range(round(scene.stop / h)):
        t, slip = i * h, abs(joint.getVelocity(0))
        if rewrites:
            joint.setCoulombFriction(0, scene.slide(t, slip) if slip > REST else scene.hold(t))
        skeleton.setForce(0, scene.load(t, rows[-1][1]))
        world.step()
        t, x, v = t + h, skeleton.getPosition(0), skeleton.getVelocity(0)
        rows.append((t, x, v, v + joint.getVelocity(0)) if moves else (t, x + w * t, v + w, w))
    table = np.array(rows)
    return Solution(table[:, 0], table[:, 1:], steps=len(rows) - 1)
