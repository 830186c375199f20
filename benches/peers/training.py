"""Trains PPO of Stable-Baselines3 on Gymnasium's CartPole-v1: reads settings and a seed a line, answers with the
nanoseconds of processor time until the mean return of the last 100 episodes is 475, or nan if it never is.

    pip install -r benches/peers/training.txt
"""

import sys
import time
import warnings

BALANCED, EPISODES = 475.0, 100

# worlds, steps, settings: as tuned for CartPole-v1 in RL Baselines3 Zoo, and the library's defaults
SETTINGS = {
    "tuned": (
        8,
        100_000,
        dict(
            n_steps=32,
            batch_size=256,
            gae_lambda=0.8,
            gamma=0.98,
            n_epochs=20,
            ent_coef=0.0,
            learning_rate=lambda left: 0.001 * left,
            clip_range=lambda left: 0.2 * left,
        ),
    ),
    "default": (1, 300_000, {}),
}


def main():
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.env_util import make_vec_env

    torch.set_num_threads(1)
    warnings.filterwarnings("ignore")

    class Balanced(BaseCallback):
        def _on_step(self):
            recent = self.model.ep_info_buffer
            if len(recent) < EPISODES or sum(episode["r"] for episode in recent) < BALANCED * EPISODES:
                return True
            self.reached = time.process_time()
            return False

    def train(name, seed):
        count, steps, settings = SETTINGS[name]
        start = time.process_time()
        worlds = make_vec_env("CartPole-v1", n_envs=count, seed=seed)
        learner = PPO("MlpPolicy", worlds, seed=seed, device="cpu", stats_window_size=EPISODES, **settings)
        balanced = Balanced()
        balanced.reached = float("nan")
        learner.learn(steps, callback=balanced)
        return balanced.reached - start

    print(" ".join(SETTINGS), flush=True)
    for line in sys.stdin:
        name, seed = line.split()
        print(train(name, int(seed)) * 1e9, flush=True)


main()
