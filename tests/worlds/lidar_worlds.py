"""Little worlds for the LiDAR tests: a rig (a mocap body) that carries the LiDAR anywhere, among boxes and meshes."""

import mujoco
import numpy as np

from fg_mujoco.lidar.beams import LidarModel

GEOM = mujoco.mjtGeom
RIG = "rig"
PREFIX = "lidar/"
EYE = PREFIX + LidarModel.load().body


def rig_spec(*, sensors=True, floor=True):
    """A floor and the rig; add geoms to its worldbody and compile."""
    spec = mujoco.MjSpec()
    if floor:
        spec.worldbody.add_geom(name="floor", type=GEOM.mjGEOM_PLANE, size=(0, 0, 1))
    rig = spec.worldbody.add_body(name=RIG, mocap=True)
    spec.attach(LidarModel.load().spec(sensors=sensors), frame=rig.add_frame(), prefix=PREFIX)
    return spec


def add_mesh(spec, name, vertices, faces=None, **geom):
    """Add a mesh geom to the world; the convex hull of `vertices` where there are no `faces`."""
    mesh = spec.add_mesh(name=name, uservert=np.ravel(vertices))
    if faces is not None:
        mesh.userface = np.ravel(faces)
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    spec.worldbody.add_geom(name=name, type=GEOM.mjGEOM_MESH, meshname=name, contype=0, conaffinity=0, **geom)


def room(spec, *, half_length, half_width, height=1.0):
    """Add four walls around the world's origin, inner faces at x = +-half_length and y = +-half_width."""
    for sign in (-1, 1):
        spec.worldbody.add_geom(type=GEOM.mjGEOM_BOX, size=(0.1, half_width + 0.2, height),
                                pos=(sign * (half_length + 0.1), 0, 0))  # fmt: skip
        spec.worldbody.add_geom(type=GEOM.mjGEOM_BOX, size=(half_length + 0.2, 0.1, height),
                                pos=(0, sign * (half_width + 0.1), 0))  # fmt: skip


def random_spec(rng, *, order=None):
    """Boxes, convex pieces and an open curvy wall, standing still, on mocap bodies and on free joints.

    `order`: in which the 21 things are added, a permutation of range(21); theirs if None.
    """
    vertices, faces, _ = curvy_walls(rng, centre=(40.0, -25.0))
    hulls = [np.array((*rng.uniform(-8, 8, 2), 0.2)) + rng.normal(0, 0.4, (12, 3)) for _ in range(8)]
    bodies = [(np.array((*rng.uniform(-8, 8, 2), 0.3)), rng.normal(size=4)) for _ in range(12)]
    boxes = [[(rng.uniform(0.05, 0.8, 3), rng.uniform(-8, 8, 3) if index < 4 else rng.normal(0, 0.3, 3),
               rng.normal(size=4)) for _ in range(2)] for index in range(12)]  # fmt: skip
    spec = rig_spec()
    for thing in range(21) if order is None else order:
        if thing == 20:
            add_mesh(spec, "walls", vertices, faces)
        elif thing >= 12:
            add_mesh(spec, f"hull_{thing}", hulls[thing - 12])
        else:
            body = spec.worldbody
            if thing >= 4:
                position, quaternion = bodies[thing]
                body = body.add_body(name=f"body_{thing}", mocap=thing < 8, pos=position, quat=quaternion)
            if thing >= 8:
                body.add_freejoint(name=f"free_{thing}")
            for size, position, quaternion in boxes[thing]:
                body.add_geom(type=GEOM.mjGEOM_BOX, size=size, pos=position, quat=quaternion)
    return spec


def curvy_walls(rng, *, centre=(0, 0), n=400, height=0.3):
    """Vertices and faces of two wavy rings of wall, about 2 m apart, and the radius midway as a function of angle."""
    angles = np.linspace(0, 2 * np.pi, n, endpoint=False)
    waves, phases, amplitudes = np.arange(2, 7), rng.uniform(0, 6, 5), rng.uniform(0, 1.2, 5)

    def radius(angle):
        return 15 + np.sum(amplitudes * np.sin(np.multiply.outer(angle, waves) + phases), axis=-1)

    vertices, faces = [], []
    index, following = np.arange(n), (np.arange(n) + 1) % n
    for ring, side in enumerate((-1.0, 1.0)):
        around = (radius(angles) + side)[:, None] * np.column_stack((np.cos(angles), np.sin(angles))) + centre
        for z in (0.0, height):
            vertices.append(np.column_stack((around, np.full(n, z))))
        quads = np.column_stack((index, following, following + n, index + n)) + 2 * n * ring
        faces.extend((quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]))
    return np.concatenate(vertices), np.concatenate(faces), radius


def place(model, data, position, *, roll=0.0, pitch=0.0, yaw=0.0):
    """Put the rig somewhere: yaw, then pitch (nose down positive), then roll."""
    quaternion = np.zeros(4)
    mujoco.mju_euler2Quat(quaternion, np.array([yaw, pitch, roll], dtype=float), "zyx")
    mocap = model.body(RIG).mocapid[0]
    data.mocap_pos[mocap], data.mocap_quat[mocap] = position, quaternion
    mujoco.mj_kinematics(model, data)


def world_rays(model, data, beams, body=EYE):
    """Origins and directions of the beams in the world. Shapes (n, 3)."""
    rotation = data.body(body).xmat.reshape(3, 3)
    return np.tile(data.body(body).xpos, (len(beams.bearings), 1)), beams.directions @ rotation.T


def mujoco_rays(model, data, beams, body=EYE):
    """The readings by mj_ray, one by one: an oracle that shares no code with either back end.

    Not mj_multiRay: in MuJoCo 3.17 its culling loses a geom now and then (seen in 3 of 3000 random worlds).
    """
    origins, directions = world_rays(model, data, beams, body)
    own, geom = model.body(body).id, np.zeros(1, np.int32)
    distances = np.array([mujoco.mj_ray(model, data, *ray, None, True, own,
                                        geom) for ray in zip(origins, directions, strict=True)])  # fmt: skip
    distances[(distances < 0) | (distances >= beams.range_max)] = np.inf
    distances[distances < beams.range_min] = -np.inf
    return distances


def disagreements(first, second, tolerance):
    """Indices of the beams on which two scans differ by more than `tolerance` [m]; inf equals inf."""
    with np.errstate(invalid="ignore"):
        return np.flatnonzero((first != second) & ~(np.abs(first - second) <= tolerance))


def random_poses(rng, count):
    """Positions (n, 3) and rotations (n, 3, 3), tilted any way, among the things of random_spec."""
    centres = rng.choice([[0.0, 0.0], [40.0, -25.0]], size=count)
    positions = np.column_stack((centres + rng.uniform(-9, 9, (count, 2)), rng.uniform(0.02, 0.8, count)))
    rotations = np.empty((count, 9))
    for rotation in rotations:
        quaternion = np.zeros(4)
        angles = np.array((rng.uniform(-3, 3), *rng.normal(0, 0.2, 2)))
        mujoco.mju_euler2Quat(quaternion, angles, "zyx")
        mujoco.mju_quat2Mat(rotation, quaternion)
    return positions, rotations.reshape(-1, 3, 3)
