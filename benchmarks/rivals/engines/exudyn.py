"""Exudyn: masses with one coordinate, and a bristle with static friction between them.

With rewrite=1 the sliding force, which is one constant, is written before each step.
"""

from typing import Any

import exudyn
import exudyn.itemInterface as items
import numpy as np

from ..scenes import NotOfferedError, Scene, Setting, Solution

VALUES = exudyn.OutputVariableType


def simulate(scene: Scene, setting: Setting) -> Solution:
    """Simulate a scene; `setting` holds step, presliding (of the bristle), decay (of static friction), and rewrite."""
    if not (scene.has_constant_sliding or setting.get("rewrite")):
        raise NotOfferedError("sliding friction is one constant force")
    container = exudyn.SystemContainer()
    mbs, step, (x, v, w) = container.AddSystem(), float(setting["step"]), scene.start
    node = mbs.AddNode(items.Node1D(referenceCoordinates=[0.0], initialCoordinates=[x], initialVelocities=[v]))
    mbs.AddObject(items.Mass1D(physicsMass=scene.inertia, nodeNumber=node))
    # the ground and the belt are a node with a constant speed
    partner = mbs.AddNode(items.Node1D(referenceCoordinates=[0.0], initialVelocities=[w]))
    mbs.AddObject(items.Mass1D(physicsMass=min(scene.partner, 1e12), nodeNumber=partner))
    markers = [mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=n, coordinate=0)) for n in (partner, node)]
    start = [float(np.sign(v - w)), x, 0.0]  # mode, last position at rest, limit stop
    history = mbs.AddNode(items.NodeGenericData(initialCoordinates=start, numberOfDataCoordinates=3))
    slide, hold = scene.slide(0.0, abs(v - w)), scene.hold(0.0)
    stiffness = hold / float(setting["presliding"])
    bristle = items.CoordinateSpringDamperExt(markerNumbers=markers, nodeNumber=history, stickingStiffness=stiffness)
    bristle.dynamicFrictionForce, bristle.staticFrictionOffsetForce = slide, hold - slide
    bristle.stickingDamping = 2.0 * np.sqrt(stiffness * scene.inertia)
    bristle.exponentialDecayStatic = float(setting["decay"])
    friction = mbs.AddObject(bristle)

    def load(mbs: Any, t: float, factor: float) -> float:
        return scene.load(t, mbs.GetNodeOutput(node, VALUES.Coordinates))

    def rewrite(mbs: Any, t: float) -> bool:
        slip = abs(mbs.GetNodeOutput(node, VALUES.Coordinates_t) - mbs.GetNodeOutput(partner, VALUES.Coordinates_t))
        mbs.SetObjectParameter(friction, "dynamicFrictionForce", scene.slide(t, slip))
        mbs.SetObjectParameter(friction, "staticFrictionOffsetForce", scene.hold(t) - scene.slide(t, slip))
        return True

    mbs.AddLoad(items.LoadCoordinate(markerNumber=markers[1], load=1.0, loadUserFunction=load))
    if not scene.has_constant_sliding:
        mbs.SetPreStepUserFunction(rewrite)
    signals = ((node, VALUES.Coordinates), (node, VALUES.Coordinates_t), (partner, VALUES.Coordinates_t))
    outputs = [items.SensorNode(nodeNumber=n, outputVariableType=kind, storeInternal=True) for n, kind in signals]
    sensors = [mbs.AddSensor(output) for output in outputs]
    mbs.Assemble()
    options, n = exudyn.SimulationSettings(), round(scene.stop / step)
    options.timeIntegration.endTime, options.timeIntegration.numberOfSteps = scene.stop, n
    options.solutionSettings.sensorsWritePeriod, options.solutionSettings.writeSolutionToFile = step, False
    mbs.SolveDynamic(options)
    tables = [mbs.GetSensorStoredData(sensor) for sensor in sensors]
    return Solution(tables[0][:, 0], np.column_stack([table[:, 1] for table in tables]), steps=n)
