"""Answers to the exercises of notebook 8."""


# %% exercise-1 right: steering in proportion to the bearing
@behaviour
def come_home(me):
    if np.isnan(me.goal_x) or np.hypot(me.goal_x, me.goal_y) < 40.0:
        return 0.0, 0.0
    bearing = np.arctan2(me.goal_y, me.goal_x)
    turn = max(-1.0, min(1.0, 2.0 * bearing))
    return me.max_speed * min(1.0, 1.0 - turn), me.max_speed * min(1.0, 1.0 + turn)
# %% exercise-1 right: without a bearing, by the ratio of both distances
@behaviour
def come_home(me):
    if me.goal_x * me.goal_x + me.goal_y * me.goal_y < 35.0**2:
        return 0, 0
    if me.goal_x > 0 and abs(me.goal_y) < 0.2 * me.goal_x:
        return me.max_speed, me.max_speed
    if me.goal_y > 0:
        return -me.max_speed, me.max_speed
    return me.max_speed, -me.max_speed
# %% exercise-1 right: one wheel stopped while it turns
@behaviour
def come_home(me):
    if np.hypot(me.goal_x, me.goal_y) < 50.0:
        return 0.0, 0.0
    bearing = np.arctan2(me.goal_y, me.goal_x)
    if bearing > 0.2:
        return 0.0, me.max_speed
    if bearing < -0.2:
        return me.max_speed, 0.0
    return me.max_speed, me.max_speed
# %% exercise-1 right: in degrees, at half the speed
@behaviour
def come_home(me):
    v = 0.5 * me.max_speed
    distance = np.sqrt(me.goal_x**2 + me.goal_y**2)
    degrees = np.degrees(np.arctan2(me.goal_y, me.goal_x))
    if distance <= 45:
        return 0, 0
    if -15 < degrees < 15:
        return me.max_speed, me.max_speed
    if degrees > 0:
        return -v, v
    return v, -v
# %% exercise-1 right: a narrow cone, and stopping at 60 units
@behaviour
def come_home(me):
    near = np.hypot(me.goal_x, me.goal_y) < 60
    if near:
        return 0.0, 0.0
    bearing = np.arctan2(me.goal_y, me.goal_x)
    if bearing > 0.1:
        return -0.5 * me.max_speed, 0.5 * me.max_speed
    if bearing < -0.1:
        return 0.5 * me.max_speed, -0.5 * me.max_speed
    return me.max_speed, me.max_speed
# %% exercise-1 hint: PASS, stand still within 30 units, ahead below 0.3, else turn to its side
@behaviour
def come_home(me):
    if np.isnan(me.goal_x):
        return PASS
    if np.hypot(me.goal_x, me.goal_y) < 30:
        return 0, 0
    bearing = np.arctan2(me.goal_y, me.goal_x)
    if abs(bearing) < 0.3:
        return me.max_speed, me.max_speed
    if bearing > 0:
        return -me.max_speed, me.max_speed
    return me.max_speed, -me.max_speed
# %% exercise-1 wrong: turning to the other side
@behaviour
def come_home(me):
    if np.hypot(me.goal_x, me.goal_y) < 30:
        return 0, 0
    bearing = np.arctan2(me.goal_y, me.goal_x)
    if abs(bearing) < 0.3:
        return me.max_speed, me.max_speed
    if bearing > 0:
        return me.max_speed, 0.0
    return 0.0, me.max_speed
# %% exercise-1 wrong: it never stands still, and turns towards the beacon again and again
@behaviour
def come_home(me):
    if np.isnan(me.goal_x):
        return PASS
    if me.goal_x > 0 and abs(me.goal_y) < me.goal_x:
        return me.max_speed, me.max_speed
    side = np.sign(me.goal_y)
    return -side * me.max_speed, side * me.max_speed
# %% exercise-1 wrong: straight on
@behaviour
def come_home(me):
    return me.max_speed, me.max_speed
# %% exercise-1 wrong: standing still
@behaviour
def come_home(me):
    return 0.0, 0.0
# %% exercise-1 wrong: it turns towards the beacon, but never drives
@behaviour
def come_home(me):
    if abs(np.arctan2(me.goal_y, me.goal_x)) < 0.3:
        return 0.0, 0.0
    return -me.max_speed, me.max_speed
# %% exercise-1 wrong: it stops too early
@behaviour
def come_home(me):
    if np.hypot(me.goal_x, me.goal_y) < 200:
        return 0, 0
    bearing = np.arctan2(me.goal_y, me.goal_x)
    if abs(bearing) < 0.3:
        return me.max_speed, me.max_speed
    if bearing > 0:
        return -me.max_speed, me.max_speed
    return me.max_speed, -me.max_speed
# %% exercise-1 wrong: away from the beacon
@behaviour
def come_home(me):
    bearing = np.arctan2(-me.goal_y, -me.goal_x)
    if abs(bearing) < 0.3:
        return me.max_speed, me.max_speed
    if bearing > 0:
        return -me.max_speed, me.max_speed
    return me.max_speed, -me.max_speed
# %% exercise-1 wrong: drives whatever is ahead
@behaviour
def come_home(me):
    if me.goal_x > 0:
        return me.max_speed, me.max_speed
    return -me.max_speed, me.max_speed
# %% exercise-1 wrong: the arguments of the angle exchanged
@behaviour
def come_home(me):
    if np.isnan(me.goal_x):
        return PASS
    if np.hypot(me.goal_x, me.goal_y) < 30.0:
        return 0.0, 0.0
    if abs(np.arctan2(me.goal_x, me.goal_y)) < 0.3:
        return me.max_speed, me.max_speed
    side = 1.0 if me.goal_y > 0.0 else -1.0
    return -side * me.max_speed, side * me.max_speed
# %% exercise-1 wrong: it stops wherever the beacon is beside it
@behaviour
def come_home(me):
    if np.isnan(me.goal_x):
        return PASS
    if abs(me.goal_x) < 30.0:
        return 0.0, 0.0
    if me.goal_x > 0.0:
        return me.max_speed, me.max_speed
    return -me.max_speed, me.max_speed
# %% exercise-2 right: goal, as far as permitted
answer = dict(strategy="A", communication="goal", communication_range=170)
# %% exercise-2 right: state, as far as permitted
answer = dict(strategy="A", communication="state", communication_range=170)
# %% exercise-2 right: goal, a little less
answer = {"communication": "goal", "strategy": "A", "communication_range": 165.0}
# %% exercise-2 right: state, a little less
answer = dict(strategy="A", communication="state", communication_range=160)
# %% exercise-2 right: goal, less
answer = dict(strategy="A", communication="goal", communication_range=np.float64(160))
# %% exercise-2 hint: as far as permitted, and a goal
answer = dict(strategy="A", communication="goal", communication_range=170)
# %% exercise-2 wrong: too short
answer = dict(strategy="A", communication="goal", communication_range=60)
# %% exercise-2 wrong: too long
answer = dict(strategy="A", communication="goal", communication_range=200)
# %% exercise-2 wrong: the other strategy, which needs no messages
answer = dict(strategy="B", communication="goal", communication_range=170)
# %% exercise-2 wrong: the other strategy by default
answer = dict(communication="state", communication_range=100)
# %% exercise-2 wrong: no messages
answer = dict(strategy="A", communication="none", communication_range=170)
# %% exercise-2 wrong: more robots
answer = dict(strategy="A", communication="goal", communication_range=170, n_robots=40)
# %% exercise-2 wrong: a range below 0
answer = dict(strategy="A", communication="goal", communication_range=-170)
# %% exercise-2 wrong: goals over 120 units
answer = dict(strategy="A", communication="goal", communication_range=120)
# %% exercise-2 wrong: states over 120 units
answer = dict(strategy="A", communication="state", communication_range=120)
# %% exercise-2 wrong: states over 100 units
answer = dict(strategy="A", communication="state", communication_range=100)
