"""Answers to the exercises of notebook 15."""


# %% exercise-1 right: over robots, one by one
class Counter(mesa.Agent):
    def step(self):
        self.near = 0
        for robot in self.model.robots:
            x, y = robot.position
            if (x - 200) ** 2 + (y - 150) ** 2 < 60**2:
                self.near += 1


# %% exercise-1 right: by agents of a type
class Counter(mesa.Agent):
    near = 0

    def step(self):
        from mesa_swarm.robots.robot import Robot

        robots = self.model.agents_by_type[Robot]
        self.near = sum(np.linalg.norm(np.array(p) - (200, 150)) < 60 for p in robots.get("position"))


# %% exercise-1 right: by complex numbers
class Counter(mesa.Agent):
    def step(self):
        places = self.model.swarm.position @ (1, 1j)
        self.near = np.count_nonzero(abs(places - (200 + 150j)) < 60)


# %% exercise-1 right: a property
class Counter(mesa.Agent):
    @property
    def near(self):
        x, y = self.model.swarm.position.T
        return float(np.sum(np.sqrt((x - 200) ** 2 + (y - 150) ** 2) < 60))

    def step(self):
        pass


# %% exercise-1 right: Mesa's space
class Counter(mesa.Agent):
    def step(self):
        from mesa_swarm.robots.robot import Robot

        agents, distances = self.model.space.get_agents_in_radius((200, 150), 60)
        self.near = len([one for one in agents if isinstance(one, Robot)])


# %% exercise-1 hint: its last stage
class Counter(mesa.Agent):
    def step(self):
        self.near = int((np.hypot(*(self.model.swarm.position - (200, 150)).T) < 60).sum())


# %% exercise-1 wrong: visitors too
class Counter(mesa.Agent):
    def step(self):
        agents, distances = self.model.space.get_agents_in_radius((200, 150), 60)
        self.near = len(agents)


# %% exercise-1 wrong: visitors
class Counter(mesa.Agent):
    def step(self):
        self.near = len(self.model.agents_by_type[Visitor])


# %% exercise-1 wrong: the counts of all steps together
class Counter(mesa.Agent):
    near = 0

    def step(self):
        self.near += int((np.hypot(*(self.model.swarm.position - (200, 150)).T) < 60).sum())


# %% exercise-1 wrong: the distance along each axis
class Counter(mesa.Agent):
    def step(self):
        self.near = int((abs(self.model.swarm.position - (200, 150)) < 60).all(axis=1).sum())


# %% exercise-1 wrong: not an agent
class Counter:
    def __init__(self, model):
        self.model = model

    def step(self):
        self.near = int((np.hypot(*(self.model.swarm.position - (200, 150)).T) < 60).sum())


# %% exercise-1 wrong: nothing is stored
class Counter(mesa.Agent):
    def step(self):
        near = len(self.model.robots)


# %% exercise-1 wrong: only when it is made
class Counter(mesa.Agent):
    def __init__(self, model):
        super().__init__(model)
        self.near = int((np.hypot(*(model.swarm.position - (200, 150)).T) < 60).sum())

    def step(self):
        pass
# %% exercise-1 wrong: moving robots away
class Counter(mesa.Agent):
    def __init__(self, model):
        super().__init__(model)
        self.near = 0
    def step(self):
        for k, robot in enumerate(self.model.robots):
            robot.position = (20 + 15 * k, 20)
# %% exercise-1 wrong: removing the robots
class Counter(mesa.Agent):
    def __init__(self, model):
        super().__init__(model)
        self.near = 0
        for robot in list(model.robots):
            robot.remove()
    def step(self):
        self.near = 0
# %% exercise-1 wrong: the first six robots
class Counter(mesa.Agent):
    def __init__(self, model):
        super().__init__(model)
        self.near = 0
    def step(self):
        self.near = sum(np.hypot(*(self.model.swarm.position[i] - (200, 150))) < 60 for i in range(6))
# %% exercise-1 wrong: with their rims
class Counter(mesa.Agent):
    def __init__(self, model):
        super().__init__(model)
        self.near = 0
    def step(self):
        self.near = int((np.hypot(*(self.model.swarm.position - (200, 150)).T) < 65).sum())
# %% exercise-2 right: turn away from the nearest
VISITOR = 4


@behaviour
def give_way(me):
    nearest, place = 20.0, -1
    for i in range(len(me.kind)):
        if me.kind[i] == VISITOR and me.distance[i] < nearest and abs(me.bearing[i]) < 1.2:
            nearest, place = me.distance[i], i
    if place < 0:
        return PASS
    if me.bearing[place] < 0:
        return -me.max_speed, me.max_speed
    return me.max_speed, -me.max_speed


# %% exercise-2 right: from a little farther
VISITOR = 4


@behaviour
def give_way(me, within=25.0):
    for i in range(len(me.kind)):
        if me.kind[i] == VISITOR and me.distance[i] < within and abs(me.bearing[i]) < 1.2:
            side = 1.0 if me.bearing[i] < 0 else -1.0
            return -side * me.max_speed, side * me.max_speed
    return PASS


# %% exercise-2 right: a plain function, by hand
def give_way(me):
    for i in range(len(me.kind)):
        if me.kind[i] == 4 and me.distance[i] < 15 and -1.2 < me.bearing[i] < 1.2:
            if me.bearing[i] < 0:
                return -1.0 * me.max_speed, 1.0 * me.max_speed
            return 1.0 * me.max_speed, -1.0 * me.max_speed
    return PASS


# %% exercise-2 right: one wheel stands
VISITOR = 4


@behaviour
def give_way(me):
    for i in range(len(me.kind)):
        if me.kind[i] == VISITOR and me.distance[i] < 22.0 and abs(me.bearing[i]) < 1.2:
            if me.bearing[i] < 0:
                return 0.0, me.max_speed
            return me.max_speed, 0.0
    return PASS


# %% exercise-2 right: by the sides of the nearest visitors on the left and right
VISITOR = 4


@behaviour
def give_way(me, within=20.0):
    left = right = within
    for i in range(len(me.kind)):
        if me.kind[i] == VISITOR and -1.2 < me.bearing[i] < 1.2:
            if me.bearing[i] >= 0:
                left = min(left, me.distance[i])
            else:
                right = min(right, me.distance[i])
    if left == within and right == within:
        return PASS
    return (me.max_speed, -me.max_speed) if left <= right else (-me.max_speed, me.max_speed)


# %% exercise-2 hint: its last stage
VISITOR = 4


@behaviour
def give_way(me):
    for i in range(len(me.kind)):
        if me.kind[i] == VISITOR and me.distance[i] < 20 and abs(me.bearing[i]) < 1.2:
            if me.bearing[i] >= 0:
                return me.max_speed, -me.max_speed
            return -me.max_speed, me.max_speed
    return PASS


# %% exercise-2 wrong: towards visitors
@behaviour
def give_way(me):
    for i in range(len(me.kind)):
        if me.kind[i] == 4 and abs(me.bearing[i]) < 1.2:
            if me.bearing[i] < 0:
                return me.max_speed, 0.5 * me.max_speed
            return 0.5 * me.max_speed, me.max_speed
    return PASS


# %% exercise-2 wrong: as if there were none
@behaviour
def give_way(me):
    return PASS


# %% exercise-2 wrong: standing for ever
@behaviour
def give_way(me):
    return 0.0, 0.0


# %% exercise-2 wrong: turning on the spot for ever
@behaviour
def give_way(me):
    return -me.max_speed, me.max_speed


# %% exercise-2 wrong: the code of another kind
VISITOR = 3


@behaviour
def give_way(me, within=20.0):
    for i in range(len(me.kind)):
        if me.kind[i] == VISITOR and me.distance[i] < within:
            return -me.max_speed, me.max_speed
    return PASS


# %% exercise-2 wrong: slowly
@behaviour
def give_way(me):
    for i in range(len(me.kind)):
        if me.kind[i] == 4:
            return 0.2 * me.max_speed, 0.2 * me.max_speed
    return PASS


# %% exercise-2 wrong: the package's own layer, which uses three of the nine sensors
give_way = Avoid(distance=20)
# %% exercise-2 wrong: giving way to robots
@behaviour
def give_way(me, within=20.0):
    for i in range(len(me.kind)):
        if me.kind[i] == 1 and me.distance[i] < within and abs(me.bearing[i]) < 1.2:
            if me.bearing[i] >= 0:
                return me.max_speed, -me.max_speed
            return -me.max_speed, me.max_speed
    return PASS
# %% exercise-2 wrong: standing for those that are very near
VISITOR = 4


@behaviour
def give_way(me, within=8.0):
    for i in range(len(me.kind)):
        if me.kind[i] == VISITOR and me.distance[i] < within:
            return 0.0, 0.0
    return PASS
# %% exercise-2 wrong: only when they touch
VISITOR = 4


@behaviour
def give_way(me, within=1.0):
    for i in range(len(me.kind)):
        if me.kind[i] == VISITOR and me.distance[i] < within and abs(me.bearing[i]) < 1.2:
            if me.bearing[i] >= 0:
                return me.max_speed, -me.max_speed
            return -me.max_speed, me.max_speed
    return PASS
# %% exercise-2 right: backing away
VISITOR = 4


@behaviour
def give_way(me, within=20.0):
    for i in range(len(me.kind)):
        if me.kind[i] == VISITOR and me.distance[i] < within and abs(me.bearing[i]) < 1.2:
            return -me.max_speed, -me.max_speed
    return PASS
