"""Trains PPO of Stable-Baselines3 on Gymnasium's CartPole-v1: reads a name and a seed a line, answers with the
nanoseconds of processor time until the mean return of the last 100 episodes is 475, or nan if it never is.

    pip install -r benches/peers/training.txt
"""

import sys
import time
import warnings

BALANCED, EPISODES = 475.0, 100

# of RL Baselines3 Zoo for CartPole-v1
WORLDS, STEPS = 8, 100_000
SETTINGS = dict(
    n_steps=32,
    batch_size=256,
    gae_lambda=0.8,
    gamma=0.98,
    n_epochs=20,
    ent_coef=0.0,
    learning_rate=lambda left: 0.001 * left,
    clip_range=lambda left: 0.2 * left,
)


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

    def train(seed):
        start = time.process_time()
        worlds = make_vec_env("CartPole-v1", n_envs=WORLDS, seed=seed)
        learner = PPO("MlpPolicy", worlds, seed=seed, device="cpu", stats_window_size=EPISODES, **SETTINGS)
        balanced = Balanced()
        balanced.reached = float("nan")
        learner.learn(STEPS, callback=balanced)
        return balanced.reached - start

    print("cart-pole", flush=True)
    for line in sys.stdin:
        print(train(int(line.split()[1])) * 1e9, flush=True)


main()
