#!/usr/bin/env python3
"""One update of DQN and one of PPO, from the papers' formulas alone.

Writes dqn.jsonl and ppo.jsonl beside itself; golden.rs holds the crate to them.

Nothing is shared with the crate but the formulas: numbers are double
precision, and gradients are central differences of the losses as the papers
state them. Every input is exact in single precision.

The weights are drawn from the first seed for which every mechanism matters:
networks disagree on the best action, errors lie on both sides of the Huber
threshold and ratios on both sides of the clip, and no number is so near to a
kink (of ReLU, argmax, Huber, clip) that rounding could take it across.
"""

import itertools
import json
import math
import os
import random
import struct

HERE = os.path.dirname(os.path.abspath(__file__))


# Networks: affine layers with ReLU between. Parameters are flat, layer by
# layer, each as biases [outputs] and weights [inputs][outputs].


def layers(sizes):
    at = 0
    for inputs, outputs in zip(sizes, sizes[1:]):
        yield inputs, outputs, at
        at += outputs + inputs * outputs


def parameters(sizes):
    return sum(o + i * o for i, o in zip(sizes, sizes[1:]))


def forward(sizes, theta, x, kinks=None):
    for k, (inputs, outputs, at) in enumerate(layers(sizes)):
        weights = at + outputs
        x = [
            theta[at + j] + sum(x[i] * theta[weights + i * outputs + j] for i in range(inputs))
            for j in range(outputs)
        ]
        if k < len(sizes) - 2:
            if kinks is not None:
                kinks.extend(abs(z) for z in x)
            x = [max(z, 0.0) for z in x]
    return x


def gradient(loss, theta):
    h = 2.0**-17
    slopes = []
    for i in range(len(theta)):
        up, down = list(theta), list(theta)
        up[i] += h
        down[i] -= h
        slope = (loss(up) - loss(down)) / (2 * h)
        slopes.append(slope if abs(slope) > 1e-9 else 0.0)
    return slopes


def argmax(values):
    return max(range(len(values)), key=lambda i: values[i])


def margin(values):
    best, second = sorted(values, reverse=True)[:2]
    return best - second


class Adam:
    """Kingma, Ba 2015, Algorithm 1, with the constants given there."""

    def __init__(self, mean, square, steps):
        self.mean, self.square, self.steps = mean, square, steps

    def step(self, theta, g, rate):
        self.steps += 1
        self.mean = [0.9 * m + 0.1 * d for m, d in zip(self.mean, g)]
        self.square = [0.999 * v + 0.001 * d * d for v, d in zip(self.square, g)]
        first, second = 1 - 0.9**self.steps, 1 - 0.999**self.steps
        return [
            p - rate * (m / first) / (math.sqrt(v / second) + 1e-8)
            for p, m, v in zip(theta, self.mean, self.square)
        ]


def line(start, end, decisions, span):
    return start + (end - start) * min(decisions / span, 1.0)


# Inputs and files.


def single(x):
    return struct.unpack("f", struct.pack("f", x))[0]


class Draw:
    """Random multiples of 1/1024: exact in single precision."""

    def __init__(self, seed):
        self.random = random.Random(seed)

    def numbers(self, n, largest):
        return [round(self.random.uniform(-largest, largest) * 1024) / 1024 for _ in range(n)]

    def moments(self, n):
        square = [single(abs(x) * 0.01 + 0.002) for x in self.numbers(n, 1.0)]
        return Adam(self.numbers(n, 0.0625), square, 4)


def tensor(kind, shape, values):
    return {"type": kind, "shape": shape, "values": list(values)}


def net(prefix, sizes, theta):
    tensors = {}
    for k, (inputs, outputs, at) in enumerate(layers(sizes)):
        weights = at + outputs
        end = weights + inputs * outputs
        tensors[f"{prefix}/{k}/bias"] = tensor("f32", [outputs], theta[at:weights])
        tensors[f"{prefix}/{k}/weight"] = tensor("f32", [inputs, outputs], theta[weights:end])
    return tensors


def moments(prefix, sizes, adam):
    return {
        **net(f"{prefix}/mean", sizes, adam.mean),
        **net(f"{prefix}/square", sizes, adam.square),
        f"{prefix}/steps": tensor("u64", [1], [adam.steps]),
    }


def counters(decisions, episodes, aborted):
    return {"counters": tensor("u64", [3], [decisions, episodes, aborted])}


DICE = {
    "dice/seed": tensor("u8", [32], list(range(32))),
    "dice/position": tensor("u64", [3], [0, 0, 0]),
}


def ron(name, config):
    fields = ", ".join(f"{key}: {value}" for key, value in config.items())
    return f"{name}({fields})"


def short(value):
    """Nine digits: more than single precision holds, the same everywhere."""
    if isinstance(value, float):
        return float(f"{value:.9g}")
    if isinstance(value, dict):
        return {key: short(v) for key, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [short(v) for v in value]
    return value


def write(name, cases):
    with open(os.path.join(HERE, name), "w") as file:
        for case in cases:
            file.write(json.dumps(short(case), ensure_ascii=False) + "\n")


# DQN. Mnih 2015 with double Q-learning (van Hasselt 2016), prioritised replay
# (Schaul 2016), the Huber loss, Adam and a target network that follows softly.


class Unfit(Exception):
    """These weights leave some mechanism without effect."""


def need(fact):
    if not fact:
        raise Unfit


def strata(leaves, batch):
    """The slot that each stratum of the total lies in, wholly: so whatever the
    random numbers are, the draws are these."""
    edges = [0.0, *itertools.accumulate(leaves)]
    part = edges[-1] / batch
    slots = []
    for i in range(batch):
        slot = max(s for s in range(len(leaves)) if edges[s] <= i * part)
        assert (i + 1) * part <= edges[slot + 1]
        slots.append(slot)
    return slots


def huber(error, threshold):
    if abs(error) <= threshold:
        return error * error / 2
    return threshold * (abs(error) - threshold / 2)


def returns(episode, discount, steps):
    """Rows (s, s', R, γ^k) of the n-step returns, all actions being greedy."""
    observations, rewards = episode["observations"], episode["rewards"]
    for t in range(len(rewards)):
        k = min(steps, len(rewards) - t)
        total = sum(discount**i * rewards[t + i] for i in range(k))
        ends = t + k == len(rewards) and episode["end"] == "Terminated"
        yield [*observations[t], *observations[t + k], total, 0.0 if ends else discount**k]


def dqn_case(name, seed, sizes, config, tally, leaves, oldest, warm, episode):
    draw = Draw(seed)
    n, width, batch = len(leaves), sizes[0], config["batch"]
    theta, target = draw.numbers(parameters(sizes), 1.0), draw.numbers(parameters(sizes), 1.0)
    adam = draw.moments(len(theta)) if warm else Adam([0.0] * len(theta), [0.0] * len(theta), 0)
    gamma = config["discount"]
    rows = [
        [*draw.numbers(2 * width, 1.0), *draw.numbers(1, 1.0), single(gamma ** (k % 3 + 1))]
        for k in range(n)
    ]
    rows[1][-1] = 0.0  # a terminal one
    actions = [k % sizes[-1] for k in range(n)]
    largest = 1.25
    bundle = {
        **net("online", sizes, theta),
        **net("target", sizes, target),
        **moments("adam", sizes, adam),
        "replay/rows": tensor("f32", [n, 2 * width + 2], sum(rows, [])),
        "replay/actions": tensor("u32", [n], actions),
        "replay/priorities": tensor("f64", [n], leaves),
        "replay/oldest": tensor("u64", [1], [oldest]),
        "replay/largest": tensor("f64", [1], [largest]),
        "starts/fresh": tensor("u64", [1], [0]),
        "starts/failed": tensor("u64", [0], []),
        "starts/tries": tensor("u32", [0], []),
        **counters(*tally),
        **DICE,
    }

    # Greedy throughout; the update comes with the last decision.
    lived = []
    for s in episode["observations"][:-1]:
        values = forward(sizes, theta, s)
        need(margin(values) > 0.01)
        lived.append(argmax(values))
    decisions = tally[0] + len(lived)
    updates = [d for d in range(tally[0] + 1, decisions + 1) if d % config["update_every"] == 0]
    assert updates == [decisions]

    slots = strata(leaves, batch)
    beta = line(config["correction"], 1.0, decisions, config["decisions"])
    weights = [(n * leaves[s] / sum(leaves)) ** -beta for s in slots]
    weights = [w / max(weights) for w in weights]
    kinks, disagree, y = [], False, []
    for row in rows:
        s, after, (r, discount) = row[:width], row[width : 2 * width], row[2 * width :]
        picks = forward(sizes, theta, after, kinks)
        judges = forward(sizes, target, after, kinks)
        forward(sizes, theta, s, kinks)
        need(margin(picks) > 0.01)
        pick = argmax(picks)
        disagree |= discount > 0 and margin(judges) > 0.1 and pick != argmax(judges)
        y.append(r + discount * judges[pick])
    errors = [forward(sizes, theta, rows[k][:width])[actions[k]] - y[k] for k in range(n)]
    threshold = config["huber"]
    beyond = [abs(e) > threshold for e in errors]
    need(min(kinks) > 0.01 and disagree and any(beyond) and not all(beyond))
    need(all(abs(abs(e) - threshold) > 0.02 for e in errors))

    def loss(theta):
        total = 0.0
        for w, k in zip(weights, slots):
            q = forward(sizes, theta, rows[k][:width])[actions[k]]
            total += w * huber(q - y[k], threshold)
        return total / batch

    g = gradient(loss, theta)
    rate = line(config["learning_rate"], config["final_learning_rate"], decisions, config["decisions"])
    theta = adam.step(theta, g, rate)
    share = config["polyak"]
    target = [(1 - share) * t + share * o for t, o in zip(target, theta)]
    priorities = [
        (abs(e) + 0.001) ** config["priority"] if k in slots else leaves[k]
        for k, e in enumerate(errors)
    ]
    largest = max([largest, *priorities])

    # Then the episode enters the replay, with the largest priority ever seen.
    capacity = math.inf if config["capacity"] == "None" else int(config["capacity"][5:-1])
    for row, action in zip(returns(episode, gamma, config["steps"]), lived):
        if len(rows) < capacity:
            rows, actions, priorities = rows + [row], actions + [action], priorities + [largest]
        else:
            rows[oldest], actions[oldest], priorities[oldest] = row, action, largest
            oldest = (oldest + 1) % capacity
    n = len(rows)
    after = {
        **net("online", sizes, theta),
        **net("target", sizes, target),
        **moments("adam", sizes, adam),
        "replay/rows": tensor("f32", [n, 2 * width + 2], sum(rows, [])),
        "replay/actions": tensor("u32", [n], actions),
        "replay/priorities": tensor("f64", [n], priorities),
        "replay/oldest": tensor("u64", [1], [oldest]),
        "replay/largest": tensor("f64", [1], [largest]),
        **counters(decisions, tally[1] + 1, tally[2]),
    }
    return {
        "name": name,
        "learner": ron("Dqn", config),
        "kind": "brakecheck dqn checkpoint 1",
        "spaces": [sizes[0], sizes[-1]],
        "before": bundle,
        "episode": episode,
        "outcomes": [{"actions": lived, "after": after}],
    }


def dqn_cases():
    common = {
        "decisions": 1000,
        "exploration": 0.0,
        "final_exploration": 0.0,
        "restart": 0.0,
        "batch": 8,
    }
    yield dict(
        name="the first step of Adam, two fifths into the schedules",
        sizes=[2, 3, 3],
        config={
            **common,
            "update_every": 2,
            "learning_starts": 4,
            "learning_rate": 0.01,
            "final_learning_rate": 0.001,
            "huber": 0.5,
            "polyak": 0.125,
            "discount": 0.75,
            "steps": 3,
            "priority": 0.7,
            "correction": 0.3,
            "capacity": "None",
        },
        tally=(399, 40, 2),
        leaves=[0.5, 1.0, 0.5, 2.0],
        oldest=0,
        warm=False,
        episode={
            "observations": [[0.5, -0.25], [0.125, 0.75]],
            "rewards": [0.375],
            "end": "Terminated",
        },
    )
    yield dict(
        name="a later step, a full memory, an episode that was cut off",
        sizes=[2, 4, 3, 2],
        config={
            **common,
            "update_every": 3,
            "learning_starts": 5,
            "learning_rate": 0.02,
            "final_learning_rate": 0.03,
            "huber": 0.25,
            "polyak": 0.5,
            "discount": 0.5,
            "steps": 2,
            "priority": 0.4,
            "correction": 0.6,
            "capacity": "Some(5)",
        },
        tally=(699, 70, 0),
        leaves=[1.0, 1.0, 2.0, 1.0, 3.0],
        oldest=3,
        warm=True,
        episode={
            "observations": [[0.5, -0.25], [0.125, 0.75], [-0.5, 0.25], [1.0, 0.5]],
            "rewards": [0.375, -0.5, 0.25],
            "end": "Truncated",
        },
    )
    yield dict(
        name="beyond the end of the schedules, in the last episode",
        sizes=[1, 4, 3],
        config={
            **common,
            "update_every": 6,
            "learning_starts": 3,
            "learning_rate": 0.05,
            "final_learning_rate": 0.01,
            "huber": 1.0,
            "polyak": 0.0625,
            "discount": 0.875,
            "steps": 1,
            "priority": 1.0,
            "correction": 0.5,
            "capacity": "None",
        },
        tally=(999, 90, 1),
        leaves=[1.0, 5.0, 2.0],
        oldest=0,
        warm=True,
        episode={
            "observations": [[0.5], [0.125], [-0.5], [1.0]],
            "rewards": [0.375, -0.5, 0.25],
            "end": "Terminated",
        },
    )


# PPO. Schulman 2017, Eq. (7) and (9); advantages of Schulman 2016, Eq. (16).


def softmax(logits):
    weights = [math.exp(z) for z in logits]
    return [w / sum(weights) for w in weights]


def advantages(rewards, values, after, discount, trace):
    """Σ (γλ)^l δ_{t+l}, written out."""
    values = [*values, after]
    deltas = [r + discount * values[t + 1] - values[t] for t, r in enumerate(rewards)]
    return [
        sum((discount * trace) ** l * d for l, d in enumerate(deltas[t:]))
        for t in range(len(deltas))
    ]


def ppo_outcome(case, lived, orders):
    """After these actions, with the rollout cut into these minibatches."""
    config, sizes = case["config"], case["sizes"]
    actor, critic = case["actor"], case["critic"]
    adams = [Adam(a.mean, a.square, a.steps) for a in case["adams"]]
    episode = case["episode"]
    rollout = [dict(step) for step in case["rollout"]]

    observations, rewards = episode["observations"], episode["rewards"]
    values = [forward(sizes[1], critic, s)[0] for s in observations]
    after = values[-1] if episode["end"] == "Truncated" else 0.0
    gae = advantages(rewards, values[:-1], after, config["discount"], config["trace"])
    for s, a, v, advantage in zip(observations, lived, values, gae):
        log = math.log(softmax(forward(sizes[0], actor, s))[a])
        rollout.append(dict(s=s, a=a, log=log, advantage=advantage, result=advantage + v))

    decisions = case["tally"][0] + len(lived)
    rate = line(config["learning_rate"], config["final_learning_rate"], decisions, config["decisions"])
    clip, limit = config["clip"], config["max_gradient"]
    seen = set()
    for order in orders(len(rollout)):
        batch = [rollout[i] for i in order]
        mean = sum(b["advantage"] for b in batch) / len(batch)
        deviation = math.sqrt(sum((b["advantage"] - mean) ** 2 for b in batch) / len(batch))
        kinks = []
        for b in batch:
            b["normal"] = (b["advantage"] - mean) / (deviation + 1e-8)
            ratio = math.exp(math.log(softmax(forward(sizes[0], actor, b["s"], kinks))[b["a"]]) - b["log"])
            forward(sizes[1], critic, b["s"], kinks)
            need(abs(ratio - 1 - clip) > 1e-3 and abs(ratio - 1 + clip) > 1e-3)
            need(len(batch) == 1 or abs(b["normal"]) > 0.01)
            where = "above" if ratio > 1 + clip else "below" if ratio < 1 - clip else "within"
            seen.add((where, b["normal"] > 0))
            if abs(b["advantage"]) > 0.1 and (b["advantage"] > 0) != (b["normal"] > 0):
                seen.add("another sign")
        need(min(kinks) > 1e-3)

        def actor_loss(theta):
            total = 0.0
            for b in batch:
                p = softmax(forward(sizes[0], theta, b["s"]))
                ratio = math.exp(math.log(p[b["a"]]) - b["log"])
                clipped = min(max(ratio, 1 - clip), 1 + clip)
                surrogate = min(ratio * b["normal"], clipped * b["normal"])
                entropy = -sum(q * math.log(q) for q in p)
                total -= surrogate + config["entropy"] * entropy
            return total / len(batch)

        def critic_loss(theta):
            errors = [forward(sizes[1], theta, b["s"])[0] - b["result"] for b in batch]
            return sum(e * e / 2 for e in errors) / len(batch)

        nets = []
        for who, theta, loss, adam in [
            ("actor", actor, actor_loss, adams[0]),
            ("critic", critic, critic_loss, adams[1]),
        ]:
            g = gradient(loss, theta)
            length = math.sqrt(sum(d * d for d in g))
            need(abs(length / limit - 1) > 0.02)
            seen.add((who, length > limit))
            g = [d * min(1.0, limit / length) for d in g] if length > 0 else g
            nets.append(adam.step(theta, g, rate))
        actor, critic = nets

    after = {
        **net("actor", sizes[0], actor),
        **net("critic", sizes[1], critic),
        **moments("actor_adam", sizes[0], adams[0]),
        **moments("critic_adam", sizes[1], adams[1]),
        **counters(decisions, case["tally"][1] + 1, case["tally"][2]),
    }
    if case["brief"]:
        after = {k: v for k, v in after.items() if k.split("/")[0] in ("actor", "critic")}
    return {"actions": lived, "after": after}, seen


def ppo_case(name, seed, sizes, config, tally, steps, warm, episode, orders, must, brief):
    draw = Draw(seed)
    actor, critic = (draw.numbers(parameters(s), 1.0) for s in sizes)
    if warm:
        adams = [draw.moments(len(actor)), draw.moments(len(critic))]
    else:
        adams = [Adam([0.0] * len(net), [0.0] * len(net), 0) for net in (actor, critic)]
    before = {
        **net("actor", sizes[0], actor),
        **net("critic", sizes[1], critic),
        **moments("actor_adam", sizes[0], adams[0]),
        **moments("critic_adam", sizes[1], adams[1]),
    }
    # Drawn by an older actor, under which they had these ratios to today's.
    rollout = []
    for k, (ratio, advantage) in enumerate(steps):
        s = draw.numbers(sizes[0][0], 1.0)
        a = k % sizes[0][-1]
        log = single(math.log(softmax(forward(sizes[0], actor, s))[a] / ratio))
        result = draw.numbers(1, 1.0)[0]
        rollout.append(dict(s=s, a=a, log=log, advantage=advantage, result=result))
    n, width = len(rollout), sizes[0][0]
    before |= {
        "rollout/observations": tensor("f32", [n, width], sum((r["s"] for r in rollout), [])),
        "rollout/actions": tensor("u32", [n], [r["a"] for r in rollout]),
        "rollout/log_probabilities": tensor("f32", [n], [r["log"] for r in rollout]),
        "rollout/advantages": tensor("f32", [n], [r["advantage"] for r in rollout]),
        "rollout/returns": tensor("f32", [n], [r["result"] for r in rollout]),
        **counters(*tally),
        **DICE,
    }
    case = dict(
        config=config, sizes=sizes, tally=tally, actor=actor, critic=critic,
        adams=adams, rollout=rollout, episode=episode, brief=brief,
    )
    outcomes = []
    every = range(sizes[0][-1])
    for lived in itertools.product(every, repeat=len(episode["rewards"])):
        for order in orders:
            outcome, seen = ppo_outcome(case, list(lived), order)
            need(must <= seen)
            outcomes.append(outcome)
    return {
        "name": name,
        "learner": ron("Ppo", config),
        "kind": "brakecheck ppo checkpoint 1",
        "spaces": [sizes[0][0], sizes[0][-1]],
        "before": before,
        "episode": episode,
        "outcomes": outcomes,
    }


def whole(epochs):
    """One minibatch of everything: shuffling does not matter."""
    return lambda n: [range(n)] * epochs


def halves_of_four():
    """Two epochs, each of two minibatches, in every way to halve four."""
    halves = [(half, tuple(set(range(4)) - set(half))) for half in itertools.combinations(range(4), 2)]
    for epochs in itertools.product(halves, repeat=2):
        yield lambda n, epochs=epochs: [batch for epoch in epochs for batch in epoch]


def ppo_cases():
    # Both sides of the clip, with advantages that say go on and turn back; and
    # ratios within this clip, beyond the default of 0.2.
    steps = [(1.75, 1.0), (0.5, -1.25), (0.5, 1.5), (1.75, -1.0), (1.25, 1.0), (0.75, -0.5), (1.0, 0.25)]
    clips = {(where, sign) for where in ("above", "below", "within") for sign in (True, False)}
    common = {"decisions": 1000, "discount": 0.875, "clip": 0.375}
    two = {
        "observations": [[0.5, -0.25], [0.125, 0.75], [-0.5, 0.25]],
        "rewards": [0.375, 1.5],
        "end": "Truncated",
    }
    yield dict(
        name="three epochs on one batch, the critic's gradients too long",
        sizes=([2, 4, 3], [2, 3, 1]),
        config={
            **common, "horizon": 9, "epochs": 3, "batch": 9, "trace": 0.75, "entropy": 0.0625,
            "learning_rate": 0.02, "final_learning_rate": 0.005, "max_gradient": 0.5,
        },
        tally=(298, 30, 1),
        steps=steps,
        warm=True,
        episode=two,
        orders=[whole(3)],
        must=clips | {("actor", False), ("critic", True), "another sign"},
        brief=False,
    )
    yield dict(
        name="two epochs from the first step of Adam, all gradients too long",
        sizes=([2, 3, 3], [2, 4, 1]),
        config={
            **common, "horizon": 5, "epochs": 2, "batch": 64, "trace": 0.5, "entropy": 0.25,
            "learning_rate": 0.01, "final_learning_rate": 0.0, "max_gradient": 0.03125,
        },
        tally=(748, 30, 1),
        steps=steps,
        warm=False,
        episode={"observations": [[0.5, -0.25], [0.125, 0.75]], "rewards": [1.5], "end": "Terminated"},
        orders=[whole(2)],
        must=clips | {("actor", True), ("critic", True)},
        brief=False,
    )
    yield dict(
        name="shuffled minibatches, no gradient too long",
        sizes=([1, 2, 2], [1, 2, 1]),
        config={
            **common, "horizon": 4, "epochs": 2, "batch": 2, "trace": 0.75, "entropy": 0.125,
            "learning_rate": 0.05, "final_learning_rate": 0.01, "max_gradient": 100.0,
        },
        tally=(499, 30, 1),
        steps=[(1.75, 1.0), (0.5, -1.25), (1.25, 0.5)],
        warm=True,
        episode={"observations": [[0.5], [0.25]], "rewards": [1.5], "end": "Terminated"},
        orders=list(halves_of_four()),
        must={("actor", False), ("critic", False)},
        brief=True,
    )


def first_fit(make, cases):
    for case in cases:
        for seed in itertools.count(1):
            try:
                yield make(seed=seed, **case)
            except Unfit:
                continue
            break


write("dqn.jsonl", first_fit(dqn_case, dqn_cases()))
write("ppo.jsonl", first_fit(ppo_case, ppo_cases()))
