"""TorchRL: specifications with and without infos, several processes, and a team."""

from torchrl.envs import GymEnv, ParallelEnv, PettingZooWrapper, check_env_specs

from minexplore.envs.multi_agent import MineParallelEnv

ID = "minexplore:MineXplore/ChileanMineEntrance-v0"


def one():
    """Return an environment of a process."""
    return GymEnv(ID)


if __name__ == "__main__":
    check_env_specs(GymEnv(ID))
    env = GymEnv(ID).auto_register_info_dict()
    check_env_specs(env)
    assert {"zone", "collision", "coverage"} <= set(env.rollout(3)["next"].keys())
    check_env_specs(PettingZooWrapper(MineParallelEnv(robots=2)))
    several = ParallelEnv(2, one)
    assert several.rollout(3).batch_size == (2, 3)
    several.close()
    print("check_env_specs, auto_register_info_dict, PettingZooWrapper, ParallelEnv")
