"""Answers to the exercises of notebook 5."""


# %% exercise-1 right: a loop over all robots
def leaders(leader):
    found = []
    for robot in range(len(leader)):
        if leader[robot] == -1 and any(other == robot for other in leader):
            found.append(robot)
    return found
# %% exercise-1 right: sets
def leaders(leader):
    follows_none = {i for i, ahead in enumerate(leader) if ahead < 0}
    return sorted(follows_none & set(leader.tolist()))
# %% exercise-1 right: a mask of followed robots
def leaders(leader):
    followed = np.zeros(len(leader), dtype=bool)
    followed[leader[leader >= 0]] = True
    return np.flatnonzero(followed & (leader == -1))
# %% exercise-1 right: numpy's membership, as a tuple
def leaders(leader):
    everyone = np.arange(leader.size)
    return tuple(everyone[np.isin(everyone, leader) & (leader < 0)])
# %% exercise-1 right: counts of followers
def leaders(leader):
    followers = np.bincount(leader + 1, minlength=len(leader) + 1)[1:]
    return np.where((followers > 0) & (leader < 0))[0].astype(float)
# %% exercise-1 right: a dictionary of followers
from collections import Counter


def leaders(leader):
    counts = Counter(int(ahead) for ahead in leader)
    del counts[-1]
    return [robot for robot in sorted(counts) if leader[robot] < 0]
# %% exercise-1 hint: each index from 0 that occurs and for which leader[i] is negative
def leaders(leader):
    return [i for i in range(len(leader)) if i in leader and leader[i] < 0]
# %% exercise-1 wrong: all that follow none, also those that no robot follows
def leaders(leader):
    return np.flatnonzero(leader < 0)
# %% exercise-1 wrong: all that are followed, also those that follow
def leaders(leader):
    return np.unique(leader[leader >= 0])
# %% exercise-1 wrong: -1 taken for the index of the last robot
def leaders(leader):
    return sorted(i for i in set(leader.tolist()) if leader[i] < 0 or i < 0)
# %% exercise-1 wrong: their number
def leaders(leader):
    return len([i for i in range(len(leader)) if i in leader and leader[i] < 0])
# %% exercise-1 wrong: a mask in place of the indices
def leaders(leader):
    return [i in leader and leader[i] < 0 for i in range(len(leader))]
# %% exercise-1 wrong: in descending order
def leaders(leader):
    return [i for i in range(len(leader)) if i in leader and leader[i] < 0][::-1]
# %% exercise-1 wrong: the followers
def leaders(leader):
    return [i for i in range(len(leader)) if leader[i] >= 0]
# %% exercise-1 wrong: counted from 1
def leaders(leader):
    return [i + 1 for i in range(len(leader)) if i in leader and leader[i] < 0]
# %% exercise-1 wrong: once for each follower
def leaders(leader):
    return sorted(i for i in leader.tolist() if i >= 0 and leader[i] < 0)
# %% exercise-1 wrong: for thirty robots only
def leaders(leader):
    return [i for i in range(30) if leader[i] < 0 and i in leader]
# %% exercise-1 wrong: without the last robot
def leaders(leader):
    return [i for i in range(len(leader) - 1) if leader[i] < 0 and i in leader]
# %% exercise-1 wrong: heads of long chains only
def leaders(leader):
    return [i for i in range(len(leader)) if leader[i] < 0 and (leader == i).sum() > 1]
# %% exercise-2 right: the leader rule alone
answer = {"head_on": "on"}
# %% exercise-2 right: the leader rule and sight of 40
answer = dict(gap=15, head_on="on", cruise_speed=0.7, sight=40)
# %% exercise-2 right: the leader rule and the shortest sight
answer = dict(gap=15, head_on="on", cruise_speed=0.7, sight=30)
# %% exercise-2 right: the leader rule, no robot drives slower
answer = dict(gap=15.0, head_on="on", cruise_speed=1.0, sight=50.0)
# %% exercise-2 right: the leader rule, the gap is never short
answer = dict(gap=0, head_on="on", cruise_speed=0.7, sight=50)
# %% exercise-2 hint: head_on is on
answer = dict(gap=15, head_on="on", cruise_speed=0.7, sight=50)
# %% exercise-2 wrong: as given
answer = dict(gap=15, head_on="off", cruise_speed=0.7, sight=50)
# %% exercise-2 wrong: robots that hardly see each other
answer = dict(gap=15, head_on="on", cruise_speed=0.7, sight=10)
# %% exercise-2 wrong: a long gap
answer = dict(gap=50, head_on="off", cruise_speed=0.7, sight=50)
# %% exercise-2 wrong: fewer robots
answer = dict(gap=15, head_on="off", cruise_speed=0.7, sight=50, n_robots=6)
# %% exercise-2 wrong: far sight, which makes chains longer
answer = dict(gap=15, head_on="off", cruise_speed=0.7, sight=100)
# %% exercise-2 wrong: True in place of on
answer = dict(gap=15, head_on=True, cruise_speed=0.7, sight=50)
# %% exercise-2 wrong: no dictionary
answer = ("on", 15, 0.7, 50)
# %% exercise-2 wrong: standing still
answer = dict(gap=15, head_on="off", cruise_speed=0, sight=50)
# %% exercise-2 wrong: at full speed
answer = dict(gap=15, head_on="off", cruise_speed=1.0, sight=50)
# %% exercise-2 wrong: no gap
answer = dict(gap=0, head_on="off", cruise_speed=0.7, sight=50)
