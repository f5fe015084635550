"""Lets CARLA drive the ego against ados that brakecheck moves and judges.

    python3 carla_bridge.py WORLD|RUN [--origin X_M Y_M YAW_DEG] [--step S] [--ado PLAYER]
                            [--starts N] [--keep DIR] [--model PATTERN]

It follows the documentation of CARLA's Python interface (0.9.16), and tests run it against a
stub of that documentation. It was never run with CARLA itself.

The origin is the place of the world's origin in CARLA's map, in CARLA's axes: the middle of
the rightmost lane, with that lane ahead. A world with an `origin`, such as those of
OpenDRIVE files, has it already. The ego is driven by CARLA's traffic manager: put your own
controller in its place, or attach your stack to the actor of the role `hero`.

CARLA shows a body one step after brakecheck places it.
"""
import argparse, json, math, os, subprocess, sys

import carla

RAISED_M = 0.3  # spawning fails where a body touches the road
MOST_STEP_S = 0.1  # CARLA's physics need shorter steps
MOST_TICKS = 20  # until the ego has its speed


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("world", metavar="WORLD|RUN")
    parser.add_argument("--origin", nargs=3, type=float, metavar=("X_M", "Y_M", "YAW_DEG"))
    parser.add_argument("--step", type=float, help="s between two ticks, the world's sample time by default")
    parser.add_argument("--ado", help="trained, neutral, random or search")
    parser.add_argument("--starts", type=int, default=40)
    parser.add_argument("--keep", help="directory for the counterexamples")
    parser.add_argument("--model", default="vehicle.*", help="pattern of the blueprints of vehicles")
    parser.add_argument("--host", default="localhost")
    parser.add_argument("--port", type=int, default=2000)
    return parser.parse_args()


class Served:
    """A running `brakecheck serve`."""

    def __init__(self, args):
        command = [os.environ.get("BRAKECHECK", "brakecheck"), "serve", args.world]
        for option in ("ado", "keep"):
            command += [f"--{option}", getattr(args, option)] if getattr(args, option) else []
        self.process = subprocess.Popen(command, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def ask(self, **message):
        print(json.dumps(message), file=self.process.stdin, flush=True)
        line = self.process.stdout.readline()
        answer = json.loads(line) if line else {"error": "brakecheck has ended"}
        return answer if "error" not in answer else sys.exit(answer["error"])

    def close(self):
        self.process.stdin.close()
        self.process.wait()


class Place:
    """The world's origin in CARLA's map. There y is to the right, and yaw clockwise in degrees."""

    def __init__(self, x_m, y_m, yaw_deg):
        self.x_m, self.y_m, self.heading_rad = x_m, -y_m, -math.radians(yaw_deg)
        self.cos, self.sin = math.cos(self.heading_rad), math.sin(self.heading_rad)

    @staticmethod
    def of(args, hello):
        """The origin that was given, or that of the world in its road file, whose y is to the left."""
        origin = hello["origin"]
        if args.origin:
            return Place(*args.origin)
        if origin is None:
            sys.exit("this world has no `origin` in a road file: give --origin X_M Y_M YAW_DEG")
        return Place(origin["x_m"], -origin["y_m"], -math.degrees(origin["heading_rad"]))

    def check(self, the_map):
        """Ends the program where CARLA's map has no lane in that direction."""
        x_m, y_m, yaw_deg = self.x_m, -self.y_m, -math.degrees(self.heading_rad)
        lane = the_map.get_waypoint(carla.Location(x_m, y_m, 0.0), project_to_road=False)
        if lane is None:
            sys.exit(f"the world's origin ({x_m:.1f}, {y_m:.1f}) is on no lane of the map {the_map.name}: give --origin")
        off_deg = math.remainder(lane.transform.rotation.yaw - yaw_deg, 360.0)
        if abs(off_deg) > 10.0:
            sys.exit(f"the lane at the world's origin has a yaw of {lane.transform.rotation.yaw:.1f} deg, and the world {yaw_deg:.1f}")

    def transform(self, body, front_m, lift_m, the_map):
        """The transform of an actor whose own origin is `front_m` behind its front and `lift_m` above the road."""
        heading_rad = body["heading_rad"]
        x_m = body["x_m"] - front_m * math.cos(heading_rad)
        y_m = body["y_m"] - front_m * math.sin(heading_rad)
        x_m, y_m = self.x_m + x_m * self.cos - y_m * self.sin, self.y_m + x_m * self.sin + y_m * self.cos
        location = carla.Location(x_m, -y_m, 0.0)
        location.z = the_map.get_waypoint(location).transform.location.z + lift_m
        # CARLA's pitch lifts the front, and its roll lifts the left side.
        return carla.Transform(location, carla.Rotation(
            pitch=-math.degrees(body["pitch_rad"]), yaw=-math.degrees(self.heading_rad + heading_rad),
            roll=math.degrees(body["roll_rad"])))

    def state(self, actor, front_m):
        """The state of the middle of an actor's front, as brakecheck reads it."""
        at, velocity = actor.get_transform(), actor.get_velocity()
        yaw_rad = -math.radians(at.rotation.yaw)
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        x_m = at.location.x + front_m * cos - self.x_m
        y_m = -at.location.y + front_m * sin - self.y_m
        turn_rad_per_s = -math.radians(actor.get_angular_velocity().z)
        return {
            "x_m": x_m * self.cos + y_m * self.sin, "y_m": y_m * self.cos - x_m * self.sin,
            "heading_rad": math.remainder(yaw_rad - self.heading_rad, math.tau),
            "speed_mps": velocity.x * cos - velocity.y * sin,
            "lateral_mps": -velocity.y * cos - velocity.x * sin + turn_rad_per_s * front_m,
            "yaw_rate_rad_per_s": turn_rad_per_s,
        }


def blueprint(library, agent, role, model):
    """The first blueprint of the agent's kind, since no model is in every version of CARLA."""
    found = sorted(library.filter("walker.pedestrian.*" if agent["on_foot"] else model), key=lambda it: it.id)
    if not agent["on_foot"]:
        wheels = 2 if agent["width_m"] < 1.2 else 4
        found = [it for it in found if int(it.get_attribute("number_of_wheels")) == wheels]
    if not found:
        sys.exit(f"CARLA has no blueprint `{model}` for `{agent['name']}`")
    if found[0].has_attribute("role_name"):
        found[0].set_attribute("role_name", role)
    return found[0]


class Bodies:
    """The actors of an episode."""

    def __init__(self, world, place, agents, ego):
        self.world, self.map, self.place = world, world.get_map(), place
        self.agents, self.ego, self.actors, self.front_m, self.lift_m = agents, ego, {}, {}, {}

    def spawn(self, bodies, model):
        library = self.world.get_blueprint_library()
        for name, body in bodies.items():
            agent = self.agents[name]
            kind = blueprint(library, agent, "hero" if name == self.ego else name, model)
            # The origin of a walker is in its middle, and that of a vehicle on the road.
            lift_m = RAISED_M + 0.5 * agent["height_m"] * agent["on_foot"]
            raised = self.place.transform(body, 0.5 * agent["length_m"], lift_m, self.map)
            actor = self.world.try_spawn_actor(kind, raised)
            if actor is None:
                sys.exit(f"CARLA has no room for `{name}` at ({raised.location.x:.1f}, {raised.location.y:.1f})")
            self.actors[name] = actor
            actor.set_simulate_physics(name == self.ego)
            # Only the actor knows the box of its blueprint, by half sizes around a centre.
            box = actor.bounding_box
            self.front_m[name] = box.location.x + box.extent.x
            self.lift_m[name] = box.extent.z - box.location.z
            off_m = max(abs(2.0 * box.extent.x - agent["length_m"]), abs(2.0 * box.extent.y - agent["width_m"]))
            if off_m > 0.5:
                print(f"note: `{name}` is {agent['length_m']:.2f} x {agent['width_m']:.2f} m, and {kind.id} is "
                      f"{2.0 * box.extent.x:.2f} x {2.0 * box.extent.y:.2f} m", file=sys.stderr)

    def move(self, bodies, names):
        for name in names:
            transform = self.place.transform(bodies[name], self.front_m[name], self.lift_m[name], self.map)
            self.actors[name].set_transform(transform)

    def others(self):
        return self.actors.keys() - {self.ego}

    def start(self, bodies):
        """Brings the ego to its speed, which CARLA sets some ticks later, and back to its start."""
        self.move(bodies, self.actors)
        self.world.tick()  # before it, CARLA reports zeros
        ego, speed_mps = self.actors[self.ego], bodies[self.ego]["speed_mps"]
        ahead = ego.get_transform().get_forward_vector()
        for _ in range(MOST_TICKS):
            ego.set_target_velocity(carla.Vector3D(ahead.x * speed_mps, ahead.y * speed_mps, ahead.z * speed_mps))
            self.world.tick()
            if abs(self.place.state(ego, 0.0)["speed_mps"] - speed_mps) < 0.5:
                break
        else:
            sys.exit(f"CARLA's ego does not get to its speed of {speed_mps:.1f} m/s")
        self.move(bodies, self.actors)

    def destroy(self):
        for actor in self.actors.values():
            actor.destroy()


def play(served, world, manager, hello, args):
    step_s = args.step or hello["sample_s"]
    if step_s > MOST_STEP_S:
        sys.exit(f"CARLA needs a step of {MOST_STEP_S} s at most, and this is {step_s} s: give --step")
    place = Place.of(args, hello)
    place.check(world.get_map())
    settings = world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = True, step_s
    world.apply_settings(settings)
    manager.set_synchronous_mode(True)
    agents = {agent["name"]: agent for agent in hello["agents"]}
    ego = next(name for name, agent in agents.items() if agent["role"] == "ego")
    failures = 0
    for index in range(args.starts):
        now = served.ask(reset={"seed": 0, "index": index, "step_s": step_s})
        bodies = Bodies(world, place, agents, ego)
        try:
            bodies.spawn(now["bodies"], args.model)
            bodies.start(now["bodies"])
            bodies.actors[ego].set_autopilot(True, manager.get_port())
            while not now["done"]:
                world.tick()
                now = served.ask(sample={ego: place.state(bodies.actors[ego], bodies.front_m[ego])})
                bodies.move(now["bodies"], bodies.others())
        finally:  # CARLA keeps the actors of a program that ends
            bodies.destroy()
        failures += now["is_success"]
        print(index, now["verdict"], now["broken_rule"] or "", now.get("kept", now.get("not_kept", "")))
    print(f"the ego fails from {failures} of {args.starts} starts, every rule judged")


def main():
    args = arguments()
    served = Served(args)
    try:
        hello = served.ask(hello={"protocol": 1})["hello"]
        client = carla.Client(args.host, args.port)
        client.set_timeout(20.0)
        world, manager = client.get_world(), client.get_trafficmanager()
        before = world.get_settings()
        try:
            play(served, world, manager, hello, args)
        finally:  # in synchronous mode, CARLA waits for ticks that nobody sends any more
            before.synchronous_mode = False
            manager.set_synchronous_mode(False)
            world.apply_settings(before)
    finally:
        served.close()


main()
