"""Stub of CARLA's Python interface, written from its documentation (0.9.16).

It holds to the sentences on which a client depends, and refuses what they forbid:

- Axes are left-handed, y to the right. Rotations are degrees: yaw clockwise, pitch up.
- In synchronous mode nothing moves before a tick, and `set_` calls act on the next tick.
- Getters return the state of the last tick. Before an actor's first, they return zeros.
- A target velocity is effective two frames after it is set.
- `spawn_actor` raises and `try_spawn_actor` returns None where a body touches another or the
  road. `find` raises for unknown blueprints.
- Bounding boxes are half sizes around a centre in the actor's frame.
- Synchronous mode requires a fixed step, of 0.1 s at most, and a synchronous traffic manager.
- Actors and synchronous mode outlive the program.

The map is a straight lane with a grade. `CARLA_STUB` is a JSON object: `log`, a file that
gets a line per tick and a last one with the state in which the program left the server, and
`x`, `y`, `z`, `yaw`, `grade` of the lane, in CARLA's axes. With `fails_at` that tick raises,
and with `blocked` a static object lies at the lane's beginning. A vehicle on autopilot keeps
its speed and weaves by two degrees.
"""
import atexit, copy, fnmatch, json, math, os

_GIVEN = json.loads(os.environ["CARLA_STUB"])
_LOG = open(_GIVEN["log"], "w", encoding="utf-8")
_HALF_WIDTH_M = 6.0


class Vector3D:
    def __init__(self, x=0.0, y=0.0, z=0.0):
        self.x, self.y, self.z = float(x), float(y), float(z)

    def __add__(self, other):
        return type(self)(self.x + other.x, self.y + other.y, self.z + other.z)

    def __mul__(self, by):
        return Vector3D(self.x * by, self.y * by, self.z * by)


class Location(Vector3D):
    def distance(self, other):
        return math.dist((self.x, self.y, self.z), (other.x, other.y, other.z))


class Rotation:
    def __init__(self, pitch=0.0, yaw=0.0, roll=0.0):
        self.pitch, self.yaw, self.roll = float(pitch), float(yaw), float(roll)


class Transform:
    def __init__(self, location=None, rotation=None):
        self.location = Location() if location is None else _of(location, Location)
        self.rotation = Rotation() if rotation is None else _of(rotation, Rotation)

    def get_forward_vector(self):
        pitch, yaw = math.radians(self.rotation.pitch), math.radians(self.rotation.yaw)
        return Vector3D(math.cos(pitch) * math.cos(yaw), math.cos(pitch) * math.sin(yaw), math.sin(pitch))


class BoundingBox:
    def __init__(self, location, extent):
        self.location, self.extent, self.rotation = location, extent, Rotation()


class WorldSettings:
    def __init__(self, synchronous_mode=False, no_rendering_mode=False, fixed_delta_seconds=None):
        self.synchronous_mode, self.no_rendering_mode = synchronous_mode, no_rendering_mode
        self.fixed_delta_seconds = fixed_delta_seconds


def _of(value, kind):
    if not isinstance(value, kind):  # as the bindings of C++ do
        raise TypeError(f"Python argument types did not match: {value!r} is no {kind.__name__}")
    return copy.deepcopy(value)


def _lane(location):
    """Distance along the lane and to its right."""
    yaw = math.radians(_GIVEN["yaw"])
    x, y = location.x - _GIVEN["x"], location.y - _GIVEN["y"]
    return x * math.cos(yaw) + y * math.sin(yaw), y * math.cos(yaw) - x * math.sin(yaw)


def _road_z(location):
    return _GIVEN["z"] + _GIVEN["grade"] * _lane(location)[0]


class LaneType:
    Driving, Sidewalk, Any = 2, 8, -2


class Waypoint:
    def __init__(self, location):
        grade = math.degrees(math.atan(_GIVEN["grade"]))
        self.transform = Transform(location, Rotation(pitch=grade, yaw=_GIVEN["yaw"]))


class Map:
    name = "Stub"

    def get_waypoint(self, location, project_to_road=True, lane_type=LaneType.Driving):
        location = _of(location, Location)
        along, aside = _lane(location)
        if not project_to_road and abs(aside) > _HALF_WIDTH_M:
            return None
        yaw = math.radians(_GIVEN["yaw"])
        on = Location(_GIVEN["x"] + along * math.cos(yaw), _GIVEN["y"] + along * math.sin(yaw))
        on.z = _road_z(on)
        return Waypoint(on)


class ActorAttribute:
    def __init__(self, id, value, is_modifiable):
        self.id, self.value, self.is_modifiable, self.recommended_values = id, value, is_modifiable, []

    def as_int(self):
        return int(self.value)

    __int__ = as_int

    def as_str(self):
        return self.value

    __str__ = as_str


class ActorBlueprint:
    def __init__(self, id, wheels, half_m, centre_m):
        self.id, self.tags, self._half_m, self._centre_m = id, id.split("."), half_m, centre_m
        self._attributes = {"role_name": ActorAttribute("role_name", "autopilot", True)}
        if wheels:
            self._attributes["number_of_wheels"] = ActorAttribute("number_of_wheels", str(wheels), False)

    def has_attribute(self, id):
        return id in self._attributes

    def get_attribute(self, id):
        if id not in self._attributes:
            raise IndexError(f"actor attribute {id!r} not found")
        return self._attributes[id]

    def set_attribute(self, id, value):
        attribute = self.get_attribute(id)
        if not isinstance(value, str):
            raise TypeError("an attribute is set by a text")
        if not attribute.is_modifiable:
            raise RuntimeError(f"attribute {id!r} is not modifiable")
        attribute.value = value


class BlueprintLibrary:
    """Vehicles and a walker of a newer version, which lacks models of older ones."""

    _all = [
        ("vehicle.lincoln.mkz", 4, (2.45, 0.92, 0.75), (0.05, 0.0, 0.74)),
        ("vehicle.dodge.charger", 4, (2.5, 0.95, 0.77), (0.1, 0.0, 0.76)),
        ("vehicle.ue4.bike", 2, (0.9, 0.3, 0.6), (0.0, 0.0, 0.6)),
        ("walker.pedestrian.0015", 0, (0.19, 0.19, 0.93), (0.0, 0.0, 0.0)),
        ("sensor.camera.rgb", 0, (0.1, 0.1, 0.1), (0.0, 0.0, 0.0)),
    ]

    def __init__(self):
        self._blueprints = [ActorBlueprint(*it) for it in self._all]

    def find(self, id):
        for blueprint in self._blueprints:
            if blueprint.id == id:
                return blueprint
        raise IndexError(f"blueprint {id!r} not found")

    def filter(self, wildcard_pattern):
        return [it for it in self._blueprints if fnmatch.fnmatch(it.id, wildcard_pattern)]

    def __iter__(self):
        return iter(self._blueprints)

    def __len__(self):
        return len(self._blueprints)


class _State:
    def __init__(self):
        self.transform, self.velocity, self.turn = Transform(), Vector3D(), Vector3D()


class Actor:
    def __init__(self, world, id, blueprint, transform):
        self._world, self.id, self.type_id, self.is_alive = world, id, blueprint.id, True
        self.attributes = {it.id: it.value for it in blueprint._attributes.values()}
        self._server, self._seen = _State(), _State()  # the state, and that of the last tick
        self._server.transform = transform
        self._physics, self._autopilot, self._pending, self._target = True, None, [], None
        self._driven_s = 0.0
        if not blueprint.id.startswith("sensor"):
            self.bounding_box = BoundingBox(Location(*blueprint._centre_m), Vector3D(*blueprint._half_m))

    def _alive(self):
        if not self.is_alive:
            raise RuntimeError("trying to operate on a destroyed actor; an actor's function was called, but the actor is already destroyed.")

    def get_transform(self):
        self._alive()
        return copy.deepcopy(self._seen.transform)

    def get_location(self):
        return self.get_transform().location

    def get_velocity(self):
        self._alive()
        return copy.deepcopy(self._seen.velocity)

    def get_angular_velocity(self):  # degrees per second
        self._alive()
        return copy.deepcopy(self._seen.turn)

    def get_acceleration(self):
        self._alive()
        return Vector3D()

    def set_transform(self, transform):
        self._alive()
        transform = _of(transform, Transform)
        self._pending.append(lambda: setattr(self._server, "transform", transform))

    def set_simulate_physics(self, enabled=True):
        self._alive()
        self._pending.append(lambda: setattr(self, "_physics", bool(enabled)))

    def set_target_velocity(self, velocity):
        self._alive()
        self._target = (self._world._frame + 2, _of(velocity, Vector3D)) if self._target is None else self._target

    def set_autopilot(self, enabled=True, tm_port=8000):
        self._alive()
        self._autopilot = tm_port if enabled else None

    def destroy(self):
        if not self.is_alive:
            return False
        self.is_alive = False
        self._world._actors.pop(self.id)
        return True

    def _advance(self, frame, delta_s):
        for act in self._pending:
            act()
        self._pending = []
        if self._target and frame >= self._target[0]:
            self._server.velocity, self._target = self._target[1], None
        if not self._physics:
            self._server.velocity = Vector3D()
        if self._autopilot is not None and self._physics:
            self._weave(delta_s)
        at = self._server.transform.location
        at.x += self._server.velocity.x * delta_s
        at.y += self._server.velocity.y * delta_s
        if self._physics:  # gravity and the ground
            at.z = _road_z(at) + _lift(self._box)
        self._seen = copy.deepcopy(self._server)


    def _weave(self, delta_s):
        state, before = self._server, self._server.transform.rotation.yaw
        self._driven_s += delta_s
        yaw = _GIVEN["yaw"] + 2.0 * math.sin(math.pi * self._driven_s)
        speed = math.hypot(state.velocity.x, state.velocity.y)
        state.transform.rotation.yaw = yaw
        state.turn = Vector3D(0.0, 0.0, math.remainder(yaw - before, 360.0) / delta_s)
        state.velocity = Vector3D(speed * math.cos(math.radians(yaw)), speed * math.sin(math.radians(yaw)))


Vehicle = Walker = Actor


def _lift(box):
    """Height of an actor's origin above the lower side of its box."""
    half, centre = box
    return half[2] - centre[2]


def _touch(a, a_at, b, b_at):
    """Whether two boxes on the ground overlap, by separating axes."""

    def corners(half, centre, at):
        yaw = math.radians(at.rotation.yaw)
        cos, sin = math.cos(yaw), math.sin(yaw)
        for sx, sy in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
            x, y = centre[0] + sx * half[0], centre[1] + sy * half[1]
            yield at.location.x + x * cos - y * sin, at.location.y + x * sin + y * cos

    boxes = [list(corners(*a, a_at)), list(corners(*b, b_at))]
    for at in (a_at, b_at):
        for turn in (0.0, 90.0):
            yaw = math.radians(at.rotation.yaw + turn)
            spans = [[x * math.cos(yaw) + y * math.sin(yaw) for x, y in box] for box in boxes]
            if max(spans[0]) < min(spans[1]) or max(spans[1]) < min(spans[0]):
                return False
    return True


class World:
    def __init__(self):
        self._settings, self._actors, self._frame, self._next = WorldSettings(), {}, 0, 1
        self._managers, self._map = {}, Map()

    def get_settings(self):
        return copy.deepcopy(self._settings)

    def apply_settings(self, world_settings):
        settings = _of(world_settings, WorldSettings)
        if settings.synchronous_mode and not settings.fixed_delta_seconds:
            raise RuntimeError("in synchronous mode, always use a fixed time-step")
        if (settings.fixed_delta_seconds or 0.0) > 0.1:
            raise RuntimeError("do not use a time-step greater than 0.1 s")
        self._settings = settings
        return self._frame

    def get_map(self):
        return self._map

    def get_blueprint_library(self):
        return BlueprintLibrary()

    def spawn_actor(self, blueprint, transform, attach_to=None):
        actor = self.try_spawn_actor(blueprint, transform, attach_to)
        if actor is None:
            raise RuntimeError("Spawn failed because of collision at spawn position")
        return actor

    def try_spawn_actor(self, blueprint, transform, attach_to=None):
        transform = _of(transform, Transform)
        box = (blueprint._half_m, blueprint._centre_m)
        if transform.location.z < _road_z(transform.location) + _lift(box) + 0.05:
            return None
        if _GIVEN.get("blocked") and _touch(box, transform, ((2.0, 2.0), (0.0, 0.0)), Waypoint(Location(_GIVEN["x"], _GIVEN["y"])).transform):
            return None
        for other in self._actors.values():
            if _touch(box, transform, other._box, other._server.transform):
                return None
        actor = Actor(self, self._next, blueprint, transform)
        actor._box = box
        self._actors[self._next] = actor
        self._next += 1
        return actor

    def tick(self, seconds=10.0):
        if not self._settings.synchronous_mode:
            raise RuntimeError("a tick in asynchronous mode: the server does not wait for it")
        for actor in self._actors.values():
            manager = self._managers.get(actor._autopilot)
            if actor._autopilot is not None and not (manager and manager._synchronous):
                raise RuntimeError("time-out: the traffic manager is not in synchronous mode")
        self._frame += 1
        if self._frame == _GIVEN.get("fails_at"):
            raise RuntimeError(f"time-out of {seconds}000ms while waiting for the simulator")
        for actor in self._actors.values():
            actor._advance(self._frame, self._settings.fixed_delta_seconds)
        _log({"frame": self._frame, "step_s": self._settings.fixed_delta_seconds, "actors": [_shown(it) for it in self._actors.values()]})
        return self._frame


class TrafficManager:
    def __init__(self, port):
        self._port, self._synchronous = port, False

    def get_port(self):
        return self._port

    def set_synchronous_mode(self, mode_switch=True):
        self._synchronous = bool(mode_switch)


_WORLD = World()


class Client:
    def __init__(self, host="127.0.0.1", port=2000, worker_threads=0):
        self._timeout_s = 5.0

    def set_timeout(self, seconds):
        self._timeout_s = float(seconds)

    def get_world(self):
        return _WORLD

    def get_trafficmanager(self, client_connection=8000):
        return _WORLD._managers.setdefault(client_connection, TrafficManager(client_connection))


def _shown(actor):
    at, box = actor._seen.transform, actor.bounding_box
    return {
        "role": actor.attributes["role_name"], "type_id": actor.type_id, "autopilot": actor._autopilot is not None,
        "physics": actor._physics, "x": at.location.x, "y": at.location.y, "z": at.location.z,
        "pitch": at.rotation.pitch, "yaw": at.rotation.yaw, "roll": at.rotation.roll,
        "front": box.location.x + box.extent.x, "lift": box.extent.z - box.location.z, "turn": actor._seen.turn.z,
        "vx": actor._seen.velocity.x, "vy": actor._seen.velocity.y,
    }


def _log(line):
    _LOG.write(json.dumps(line) + "\n")


@atexit.register
def _left():
    _log({"left": {
        "synchronous": _WORLD._settings.synchronous_mode,
        "managers": [it._synchronous for it in _WORLD._managers.values()],
        "actors": len(_WORLD._actors), "ticks": _WORLD._frame,
    }})
    _LOG.close()
