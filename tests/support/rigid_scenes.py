"""Scenes of rigid bodies, and what their states say: maps, centres of mass, momentum, kinetic energy."""

from dataclasses import dataclass

import numpy as np

from clothsim import Scene, Simulation
from clothsim.physics.energies.rigid_bodies import rigidity

ASIDE = {"mesh": "rectangle", "size": [0.1, 0.1], "cells": [2, 2], "position": [0.0, 3.0, 2.0]}
"""A piece of cloth that takes no part: a scene has one."""
EFFECTS = {"inertia": {}, "membrane": {}, "gravity": {}}
WEIGHTLESS = {"inertia": {}, "membrane": {}}


def rigid_scene(rigid, body=(), effects=EFFECTS, dt=0.01, duration=0.1, cloth=ASIDE, **solver):
    """A scene of rigid bodies with BDF2."""
    settings = {"dt": dt, "threads": 1, "tolerance": 1e-6, **solver}
    run = {"duration": duration, "frames_per_second": 1 / duration}
    return Scene(cloth=cloth, body=body, rigid=rigid, effects=effects, solver=settings, run=run)


@dataclass(frozen=True)
class Moment:
    """State of the rigid bodies at a time [s]: maps A (b, 3, 3), and of the first one the centre and its velocity."""

    time: float
    maps: np.ndarray
    strain: float
    centre: np.ndarray
    velocity: np.ndarray


def moments_of(scene):
    """Every step of a scene; the simulation itself is the second."""
    simulation = Simulation(scene)
    world = simulation._session.built.world
    energy, body, rows = rigidity(world), world.rigid[0], world.coordinate_slices[0]
    found = []
    for _ in simulation:
        state = simulation._state
        centre, velocity = (body.weighing @ each[rows] / body.mass for each in (state.positions, state.velocities))
        centre = centre + world.origin
        strain = float(np.abs(energy.strains(state.positions)).max())
        found.append(Moment(state.time, energy._maps(state.positions), strain, centre, velocity))
    assert simulation.failure is None
    return found, simulation


def momentum(simulation):
    """Linear and angular momentum [kg m/s, kg m2/s] and kinetic energy [J] of all free rigid bodies."""
    world, state = simulation._session.built.world, simulation._state
    linear, angular, energy = np.zeros(3), np.zeros(3), 0.0
    for body, rows in zip(world.rigid, world.coordinate_slices, strict=True):
        carried = body.masses[:, None] * state.velocities[rows]
        linear += carried.sum(axis=0)
        angular += np.cross(state.positions[rows] + world.origin, carried).sum(axis=0)
        energy += 0.5 * float((carried * state.velocities[rows]).sum())
    return linear, angular, energy
