#!/usr/bin/env python3
"""Strain of tetrahedra: PositionBasedDynamics (pypbd), pbatoolkit and this package, in turn, on one and two threads.

    python3 -m venv V && V/bin/pip install pypbd pbatoolkit
    V/bin/python test/benchmark/pbd_peers.py BUILD_FOLDER/tissue_sim_benchmark

A cube of 14^3 cells of edge 1, six tetrahedra each, shaken by a hundredth of an edge at random; numbers of tetrahedra
are in the order of cells, as the libraries' own demos have them. An item is one tetrahedron projected once: all six
strains of it (pypbd's StrainTetConstraint, its XPBD and quasi-static FEM ones) or deviatoric and hydrostatic
(pbatoolkit's StableNeoHookean). Of each library the time of a step with 41 iterations less that of a step with one, over
40: what it does besides is left out, in its favour. What a library added is counted, and places must have moved.
"""
import itertools
import json
import os
import subprocess
import sys
import time

N = 14
ROUNDS = 40
REPEATS = 2


def cube():
    import numpy as np
    places = np.array(list(itertools.product(range(N + 1), repeat=3)), float)
    number = lambda c: (c[0] * (N + 1) + c[1]) * (N + 1) + c[2]
    tets = []
    for cell in itertools.product(range(N), repeat=3):
        for axes in itertools.permutations(range(3)):
            at, corners = list(cell), [number(cell)]
            for axis in axes:
                at[axis] += 1
                corners.append(number(at))
            x = places[corners]
            if np.linalg.det(x[1:] - x[0]) < 0:
                corners[2], corners[3] = corners[3], corners[2]
            tets.append(corners)
    return places, np.array(tets), np.random.default_rng(1).uniform(-0.01, 0.01, places.shape)


def per_item(step, items):
    """Seconds an item; step(n) takes a step of n iterations."""
    best = {}
    for n in (1, 1 + ROUNDS):
        step(n)
        for _ in range(REPEATS):
            begin = time.perf_counter()
            step(n)
            best[n] = min(best.get(n, 1e9), time.perf_counter() - begin)
    return (best[1 + ROUNDS] - best[1]) / (ROUNDS * items)


def pypbd_kind(kind):
    import numpy as np
    import pypbd
    places, tets, aside = cube()
    simulation = pypbd.Simulation.getCurrent()
    simulation.initDefault()
    model = simulation.getModel()
    # An edge of 1: what has a determinant below 1e-6 pypbd leaves out without a word.
    model.addTetModel(places, tets.flatten().tolist(), False, False)
    added = 0
    for t in tets:
        corners = [int(v) for v in t]
        if kind == "strain":
            added += model.addStrainTetConstraint(*corners, 1.0, 1.0, False, False)
        else:
            added += model.addFEMTetConstraint(*corners, 1.0e3, 0.3)
    assert added == len(tets) == len(model.getConstraints()), (added, len(tets))
    particles = model.getParticles()
    for i, d in enumerate(aside):
        particles.setPosition(i, places[i] + d)
    controller = simulation.getTimeStep()
    controls = pypbd.TimeStepController
    controller.setValueUInt(controls.NUM_SUB_STEPS, 1)
    controller.setValueUInt(controls.MAX_ITERATIONS_V, 0)
    pypbd.TimeManager.getCurrent().setTimeStepSize(1e-5)

    def step(iterations):
        controller.setValueUInt(controls.MAX_ITERATIONS, iterations)
        controller.step(model)

    before = np.array([particles.getPosition(i) for i in range(100)])
    seconds = per_item(step, added)
    after = np.array([particles.getPosition(i) for i in range(100)])
    assert np.isfinite(after).all() and np.abs(after - before).max() > 1e-4, "nothing moved"
    return added, seconds


def pbatoolkit():
    import numpy as np
    from pbatoolkit import pbat
    places, tets, aside = cube()
    data = pbat.sim.xpbd.Data().with_volume_mesh(np.asfortranarray(places.T), np.asfortranarray(tets.T.astype(np.int64)))
    faces = np.sort(np.concatenate([np.delete(tets, k, axis=1) for k in range(4)]), axis=1)
    faces, count = np.unique(faces, axis=0, return_counts=True)
    faces = faces[count == 1].astype(np.int64)  # it wants a surface
    data = data.with_surface_mesh(np.unique(faces), np.asfortranarray(faces.T))
    data = data.with_bodies(np.zeros(len(places), np.int64))
    data = data.with_mass_inverse(np.ones(len(places)))
    young, poisson = 1e6, 0.3
    lame = np.array([[young / (2 * (1 + poisson))], [young * poisson / ((1 + poisson) * (1 - 2 * poisson))]])
    data = data.with_elastic_material(np.asfortranarray(np.repeat(lame, len(tets), axis=1)))
    # The colours: greedy, as pbatoolkit's own helper for graphs gives them.
    taken, colour = [set() for _ in places], np.zeros(len(tets), int)
    for k, t in enumerate(tets):
        c = 0
        while any(c in taken[v] for v in t):
            c += 1
        colour[k] = c
        for v in t:
            taken[v].add(c)
    order = np.argsort(colour, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(colour))])
    data = data.with_partitions([int(v) for v in starts], [int(v) for v in order])
    integrator = pbat.sim.xpbd.Integrator(data.construct())
    integrator.x = np.asfortranarray((places + aside).T)
    before = integrator.x.copy()

    def step(iterations):
        integrator.step(0.01, iterations, 1)

    seconds = per_item(step, len(tets))
    after = integrator.x
    assert np.isfinite(after).all() and np.abs(after - before).max() > 1e-4, "nothing moved"
    return len(tets), seconds


PEERS = {"pypbd, strain": lambda: pypbd_kind("strain"), "pypbd, FEM": lambda: pypbd_kind("fem"),
         "pbatoolkit, StableNeoHookean": pbatoolkit}


def ours(benchmark):
    out = subprocess.run([benchmark, "--benchmark_filter=pbd/cpu/(strain|elastic)", "--benchmark_format=json"],
                         stdout=subprocess.PIPE, check=True).stdout
    rows = {}
    for row in json.loads(out)["benchmarks"]:
        name = row["name"].split("/")
        rows[name[2], int(name[3].split(":")[1])] = row["constraints"], 1 / row["items_per_second"]
    return rows


def main():
    if len(sys.argv) == 3:  # a peer by itself, for threads are counted when a library is loaded
        print("%d %.9g" % PEERS[sys.argv[2]]())
        return
    rows = []
    for threads in (1, 2):
        for name in PEERS:
            more = {key: str(threads) for key in ("OMP_NUM_THREADS", "TBB_NUM_THREADS", "NUMEXPR_NUM_THREADS")}
            command = ["taskset", "-c", ",".join(map(str, range(threads))), sys.executable, __file__, sys.argv[1], name]
            done = subprocess.run(command, stdout=subprocess.PIPE, env=dict(os.environ, **more))
            if done.returncode != 0:
                rows.append((name, threads, None, None))
                continue
            count, seconds = done.stdout.split()[-2:]
            rows.append((name, threads, int(count), 1e-6 / float(seconds)))
    for (kind, threads), (count, seconds) in sorted(ours(sys.argv[1]).items()):
        rows.append(("this package, " + kind, threads, int(count), 1e-6 / seconds))
    print("| | tetrahedra | threads | M projections/s |\n| --- | --- | --- | --- |")
    for name, threads, count, speed in rows:
        print("| %s | %s | %d | %s |" % (name, count, threads, "failed" if speed is None else "%.2f" % speed))
    for threads in (1, 2):
        best = max((speed, name) for name, n, _, speed in rows if speed and n <= threads and "package" not in name)
        own = [speed for name, n, _, speed in rows if n == threads and name == "this package, strain"]
        print("strain on %d threads: %.1f times %s, on as many or fewer" % (threads, own[0] / best[0], best[1]))


if __name__ == "__main__":
    main()
