"""Drake's MultibodyPlant: a ball that slides on the ground, with steps (time_step > 0) or continuous (time_step = 0).

Contacts have static and dynamic friction, regularised below stiction_tolerance; joints have no dry friction.
"""

import numpy as np
from pydrake import geometry, math, trajectories
from pydrake.multibody import plant as multibody
from pydrake.multibody import tree
from pydrake.systems import analysis, framework, primitives

from ..scenes import NotOfferedError, Scene, Setting, Solution

RADIUS, SETTLING = 0.1, 1.0  # m; s in which the ball sinks into the ground before the scene begins


def simulate(scene: Scene, setting: Setting) -> Solution:
    """Simulate a scene; `setting` holds options of MultibodyPlantConfig and of SimulatorConfig."""
    if scene.is_rotation:
        raise NotOfferedError("joints have no dry friction")
    if not scene.has_constant_sliding:
        raise NotOfferedError("sliding friction is constant")
    if not scene.has_one_coefficient and setting.get("time_step") != 0.0:
        raise NotOfferedError("the discrete plant ignores the static coefficient")
    plant_options = {name: value for name, value in setting.items() if hasattr(multibody.MultibodyPlantConfig, name)}
    options = analysis.SimulatorConfig(**{name: value for name, value in setting.items() if name not in plant_options})
    builder, direction, still = framework.DiagramBuilder(), [0.0, 0.0, 1.0], math.RigidTransform()
    plant, _ = multibody.AddMultibodyPlant(multibody.MultibodyPlantConfig(**plant_options), builder)
    solid = tree.UnitInertia.SolidSphere(RADIUS)
    ball = plant.AddRigidBody("ball", tree.SpatialInertia(scene.inertia, np.zeros(3), solid))
    carrier = plant.AddRigidBody("carrier", tree.SpatialInertia.Zero())
    track = tree.PrismaticJoint("track", plant.world_frame(), carrier.body_frame(), [1.0, 0.0, 0.0])
    plant.AddForceElement(tree.PrismaticSpring(plant.AddJoint(track), 0.0, scene.stiffness))
    plant.AddJoint(tree.PrismaticJoint("lift", carrier.body_frame(), ball.body_frame(), direction))
    weight = scene.inertia * plant.gravity_field().kDefaultStrength
    friction = multibody.CoulombFriction(scene.hold(0.0) / weight, scene.slide(0.0, 0.0) / weight)
    plant.RegisterCollisionGeometry(plant.world_body(), still, geometry.HalfSpace(), "ground", friction)
    plant.RegisterCollisionGeometry(ball, still, geometry.Sphere(RADIUS), "ball", friction)
    plant.Finalize()
    loads = [[scene.load(t, 0.0) for t in (0.0, scene.stop)], [0.0, 0.0]]  # linear in time
    source = primitives.TrajectorySource(trajectories.PiecewisePolynomial.FirstOrderHold([0.0, scene.stop], loads))
    port = plant.get_applied_generalized_force_input_port()
    builder.Connect(builder.AddSystem(source).get_output_port(), port)
    logger = primitives.LogVectorOutput(plant.get_state_output_port(), builder)
    simulator = analysis.Simulator(builder.Build())
    analysis.ApplySimulatorConfig(options, simulator)
    context = simulator.get_mutable_context()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    plant.SetPositions(plant_context, [0.0, RADIUS])
    simulator.AdvanceTo(SETTLING)
    height = plant.GetPositions(plant_context)[1]
    plant.SetPositionsAndVelocities(plant_context, [scene.start[0], height, scene.start[1], 0.0])
    context.SetTime(0.0)
    log = logger.FindMutableLog(context)
    log.Clear()
    simulator.Initialize()  # logs the start
    simulator.AdvanceTo(scene.stop)
    x, _, v, _ = log.data()
    return Solution(log.sample_times(), np.column_stack([x, v, np.zeros(len(x))]), steps=len(x) - 1)
