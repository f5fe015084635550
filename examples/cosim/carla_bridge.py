"""Lets CARLA drive the ego against a trained ado that brakecheck moves and judges.

    python3 carla_bridge.py RUN X_M Y_M YAW_DEG [STARTS] [KEEP]

UNTESTED: written for CARLA 0.9.15, which does not run on the machine of this repository.

RUN is a training in a world with an ego and other cars on straight lanes, such as cut_in.
X_M, Y_M and YAW_DEG are the place in CARLA's map of the world's origin: the middle of the
right lane, with that lane ahead. The ego is driven by CARLA's traffic manager. Put your own
controller in its place, or attach your stack to the actor of the role `hero`.
"""
import json, math, os, subprocess, sys

import carla

run, x_m, y_m, yaw_deg, starts, keep = (sys.argv[1:] + ["40", ""][len(sys.argv) - 5:])[:6]
origin = (float(x_m), -float(y_m), -math.radians(float(yaw_deg)))  # CARLA's y is to the right


def ask(**message):
    print(json.dumps(message), file=ado.stdin, flush=True)
    answer = json.loads(ado.stdout.readline())
    return answer if "error" not in answer else sys.exit(answer["error"])


def to_carla(body, length_m):  # front bumper here, middle of the box there
    x, y = (body[at] - 0.5 * length_m * turn(body["heading_rad"]) for at, turn in (("x_m", math.cos), ("y_m", math.sin)))
    cos, sin = math.cos(origin[2]), math.sin(origin[2])
    place = carla.Location(origin[0] + x * cos - y * sin, -(origin[1] + x * sin + y * cos), 0.1)
    return carla.Transform(place, carla.Rotation(yaw=-math.degrees(origin[2] + body["heading_rad"])))


def from_carla(actor, length_m):
    at, velocity = actor.get_transform(), actor.get_velocity()
    x, y, cos, sin = at.location.x - origin[0], -at.location.y - origin[1], math.cos(origin[2]), math.sin(origin[2])
    heading = math.remainder(-math.radians(at.rotation.yaw) - origin[2], math.tau)
    return {"x_m": x * cos + y * sin + 0.5 * length_m * math.cos(heading), "y_m": y * cos - x * sin + 0.5 * length_m * math.sin(heading),
            "heading_rad": heading, "speed_mps": math.hypot(velocity.x, velocity.y)}


command = [os.environ.get("BRAKECHECK", "brakecheck"), "serve", run] + ["--keep", keep] * bool(keep)
ado = subprocess.Popen(command, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
hello = ask(hello={"protocol": 1})["hello"]
length_m = {agent["name"]: agent["length_m"] for agent in hello["agents"]}
ego = next(agent["name"] for agent in hello["agents"] if agent["role"] == "ego")
client = carla.Client("localhost", 2000)
world, manager = client.get_world(), client.get_trafficmanager()
world.apply_settings(carla.WorldSettings(synchronous_mode=True, fixed_delta_seconds=hello["sample_s"]))
manager.set_synchronous_mode(True)
failures = 0
for index in range(int(starts)):
    now, actors = ask(reset={"seed": 0, "index": index}), {}
    for name, body in now["bodies"].items():
        blueprint = world.get_blueprint_library().find("vehicle.tesla.model3")
        blueprint.set_attribute("role_name", "hero" if name == ego else name)
        actors[name] = world.spawn_actor(blueprint, to_carla(body, length_m[name]))
        actors[name].set_simulate_physics(name == ego)
    ahead = actors[ego].get_transform().get_forward_vector()
    actors[ego].set_target_velocity(ahead * now["bodies"][ego]["speed_mps"])
    actors[ego].set_autopilot(True, manager.get_port())
    while not now["done"]:
        world.tick()
        now = ask(sample={ego: from_carla(actors[ego], length_m[ego])})
        for name in actors.keys() - {ego}:
            actors[name].set_transform(to_carla(now["bodies"][name], length_m[name]))
    failures += now["is_success"]
    print(index, now["verdict"], now["broken_rule"] or "", now.get("kept", now.get("not_kept", "")))
    client.apply_batch_sync([carla.command.DestroyActor(actor) for actor in actors.values()], True)
print(f"the ego fails from {failures} of {starts} starts, every rule judged")
