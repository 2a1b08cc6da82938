"""Answers to the exercises of notebook 2."""


# %% exercise-1 right: 25
answer = dict(distance=25, turn="translational")
# %% exercise-1 right: 28
answer = {"turn": "translational", "distance": 28.0}
# %% exercise-1 right: 30 and the turn as it is
answer = dict(distance=30)
# %% exercise-1 right: 32
answer = dict(distance=32, turn="translational")
# %% exercise-1 right: twice the old distance, a NumPy number
answer = dict(distance=np.float64(2 * 15), turn="translational")
# %% exercise-1 right: from the delay
delay, speed, radius = 20, 1.0, 5
answer = dict(distance=delay * speed + 2 * radius, turn="translational")
# %% exercise-1 hint: 35
answer = dict(distance=35, turn="translational")
# %% exercise-1 wrong: as it was
answer = dict(distance=15, turn="translational")
# %% exercise-1 wrong: on the spot
answer = dict(distance=30, turn="stationary")
# %% exercise-1 wrong: on the spot, nearer
answer = dict(distance=20, turn="stationary")
# %% exercise-1 wrong: on the spot, as it was
answer = dict(distance=15, turn="stationary")
# %% exercise-1 wrong: farther than the sensors reach
answer = dict(distance=1000, turn="translational")
# %% exercise-1 wrong: as far as the sensors reach
answer = dict(distance=50, turn="translational")
# %% exercise-1 wrong: nothing is near
answer = dict(distance=0, turn="translational")
# %% exercise-1 wrong: another turn
answer = dict(distance=30, turn="left")
# %% exercise-1 wrong: a number
answer = 30
# %% exercise-1 wrong: exact sensors
answer = dict(distance=15, period=1)
# %% exercise-1 wrong: a little farther than the distance between two readings
answer = dict(distance=20, turn="translational")
# %% exercise-1 wrong: nearer
answer = dict(distance=10, turn="translational")
# %% exercise-1 wrong: nearly as far as the sensors reach
answer = dict(distance=47, turn="translational")
# %% exercise-2 right: the square root of half of 36
deviation = np.sqrt(18)
# %% exercise-2 right: rounded
deviation = 4.24
# %% exercise-2 right: a list of equally frequent readings
deviation = np.std([30, 30, 24, 36])
# %% exercise-2 right: from the second moment
deviation = (0.5 * 30**2 + 0.25 * 24**2 + 0.25 * 36**2 - 30**2) ** 0.5
# %% exercise-2 right: 3 times the root of 2, with one digit
deviation = 4.2
# %% exercise-2 right: in an array of one number
deviation = np.array(6 * 0.5**0.5)
# %% exercise-2 hint: the mean squared error is half of 6 * 6
deviation = (6 * 6 / 2) ** 0.5
# %% exercise-2 wrong: the error itself
deviation = 6
# %% exercise-2 wrong: the mean absolute error
deviation = 3
# %% exercise-2 wrong: the variance
deviation = 18
# %% exercise-2 wrong: a quarter of the readings only
deviation = (0.25 * 36) ** 0.5
# %% exercise-2 wrong: as a share of the distance
deviation = 0.1414
# %% exercise-2 wrong: the divisor n - 1
deviation = np.std([30, 30, 24, 36], ddof=1)
# %% exercise-2 wrong: a text
deviation = "4.24"
# %% exercise-2 wrong: the sum of squares
deviation = (36 + 36) ** 0.5
# %% exercise-2 wrong: a third of the readings each
deviation = np.std([24, 30, 36])
# %% exercise-2 wrong: negative
deviation = -(18**0.5)
