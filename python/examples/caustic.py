"""A caustic in twenty lines: a glass ball under a small lamp, built from numpy arrays."""

import numpy as np

import opsr

floor = np.array([[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]])
lift = np.array([[0.5, 0, 0, 0], [0, 0.5, 0, 0.6], [0, 0, 0.5, 0], [0, 0, 0, 1]])
lamp = np.array([[0.1, 0, 0, 1.5], [0, 0, -0.1, 3], [0, 0.1, 0, 0.5], [0, 0, 0, 1]])
scene = opsr.Scene.build(
    [
        {"positions": floor, "triangles": [[0, 1, 2], [0, 2, 3]], "material": {"color": 0.7, "name": "floor"}},
        {"shape": "sphere", "to_world": lift, "material": {"type": "glass", "ior": 1.5, "name": "ball"}},
        {"shape": "rectangle", "to_world": lamp, "flip": True, "material": {"color": 0, "emission": 300}},
    ],
    cameras=[{"position": [0, 2.5, 4], "target": [0, 0.3, 0], "fov": 40}],
    environment=0.02,
)
film = opsr.render(scene, spp=64, size=(320, 240), table="beta-0.001")
film.save("caustic.png")
# The same scene with a rougher ball, without building it again.
opsr.render(scene.changed(materials={"ball": {"type": "glass", "alpha": 0.1}}), spp=16, size=(160, 120))
