"""Trains PPO, SAC, TD3, DDPG and DQN of Stable-Baselines3 on the worlds of the program at the other end of the pipe.
Lines are JSON:

- The program sends a run: algorithm, seed, settings, sizes and first observations of its worlds.
- Each list of actions is answered with the results of a step of all worlds; `null` ends training.
- Each observation is answered with the action of the trained policy; `null` ends the evaluation.

    pip install -r benches/peers/training.txt
"""

import itertools
import json
import math
import sys

import numpy as np
import torch
from gymnasium.spaces import Box, Discrete
from stable_baselines3 import DDPG, DQN, PPO, SAC, TD3
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.vec_env import VecEnv, VecNormalize


def send(value):
    print(json.dumps(value), flush=True)


def receive():
    return json.loads(sys.stdin.readline())


class Worlds(VecEnv):
    def __init__(self, run):
        self.first = np.array(run["observations"], np.float32)
        count, inputs = self.first.shape
        low, high = run["bounds"]
        actions = Box(low, high, (run["actions"],), np.float32)
        self.choices = None
        if bins := run["settings"].get("bins"):
            # all combinations of evenly spaced values
            self.choices = list(itertools.product(np.linspace(low, high, bins), repeat=run["actions"]))
            actions = Discrete(len(self.choices))
        super().__init__(count, Box(-np.inf, np.inf, (inputs,), np.float32), actions)

    def reset(self):
        return self.first

    def action(self, chosen):
        return [float(number) for number in (chosen if self.choices is None else self.choices[chosen])]

    def step_async(self, actions):
        send([self.action(chosen) for chosen in actions])

    def step_wait(self):
        step = receive()
        infos = [{} for _ in step["ends"]]
        for info, end in zip(infos, step["ends"]):
            if end:
                info["terminal_observation"] = np.array(end["observation"], np.float32)
                info["TimeLimit.truncated"] = end["truncated"]
        observations, rewards = (np.array(step[key], np.float32) for key in ("observations", "rewards"))
        return observations, rewards, np.array([end is not None for end in step["ends"]]), infos

    def close(self):
        pass

    def get_attr(self, name, indices=None):
        return [None] * self.num_envs

    def set_attr(self, name, value, indices=None):
        raise NotImplementedError

    def env_method(self, name, *arguments, indices=None, **options):
        raise NotImplementedError

    def env_is_wrapped(self, wrapper, indices=None):
        return [False] * self.num_envs


def ppo(settings, _):
    missing = ("target_kl", "recurrent", "mirror")
    assert not any(settings.get(key) for key in missing), "settings that PPO does not have here"
    rate = settings["rate"]
    return PPO, dict(
        n_steps=settings["horizon"],
        batch_size=settings["minibatch"],
        n_epochs=settings["epochs"],
        learning_rate=(lambda left: rate * left) if settings["anneal"] else rate,
        gae_lambda=settings["lambda"],
        clip_range=settings["clip"],
        ent_coef=settings["entropy"],
        # motorium halves the squared error
        vf_coef=settings["value"] / 2,
        max_grad_norm=settings["gradient"],
        policy_kwargs=dict(net_arch=settings["hidden"], log_std_init=math.log(settings["deviation"])),
    )


def replay(settings):
    assert settings["n_step"] == 1, "returns of one step"
    return dict(
        learning_starts=settings["warmup"],
        train_freq=1,
        gradient_steps=settings["gradients"],
        buffer_size=settings["buffer"],
        batch_size=settings["minibatch"],
        tau=settings["polyak"],
        learning_rate=settings["rate"],
        policy_kwargs=dict(net_arch=settings["hidden"]),
    )


def sac(settings, actions):
    return SAC, dict(
        replay(settings),
        ent_coef=f"auto_{settings['temperature']}",
        target_entropy=settings["entropy"] * actions,
    )


def td3(settings, actions):
    return TD3, dict(
        replay(settings),
        action_noise=NormalActionNoise(np.zeros(actions), np.full(actions, settings["noise"])),
        policy_delay=settings["delay"],
        target_policy_noise=settings["target_noise"],
        target_noise_clip=settings["target_clip"],
    )


def ddpg(settings, actions):
    noise = NormalActionNoise(np.zeros(actions), np.full(actions, settings["noise"]))
    return DDPG, dict(replay(settings), action_noise=noise)


def dqn(settings, _):
    assert not settings["double"], "DQN here has one network for choice and value"
    return DQN, replay(settings) | dict(
        # targets move once after the gradients of a step, not after each
        tau=1 - (1 - settings["polyak"]) ** settings["gradients"],
        target_update_interval=1,
        exploration_initial_eps=settings["epsilon"],
        exploration_final_eps=settings["final_epsilon"],
        exploration_fraction=settings["exploration"],
    )


ALGORITHMS = {"ppo": ppo, "sac": sac, "td3": td3, "ddpg": ddpg, "dqn": dqn}


def main():
    torch.set_num_threads(1)
    print(*ALGORITHMS, flush=True)
    for line in sys.stdin:
        run = json.loads(line)
        name, settings = run["algorithm"], run["settings"]
        algorithm, options = ALGORITHMS[name](settings, run["actions"])
        discount = settings["discount"]
        plain = Worlds(run)
        worlds = VecNormalize(plain, norm_reward=name == "ppo", gamma=discount, clip_obs=np.inf)
        options.update(gamma=discount, seed=run["seed"], device="cpu")
        learner = algorithm("MlpPolicy", worlds, **options)
        learner.learn(settings["steps"])
        send(None)
        while (observation := receive()) is not None:
            normal = worlds.normalize_obs(np.array(observation, np.float32))
            send(plain.action(learner.predict(normal, deterministic=True)[0]))


main()
