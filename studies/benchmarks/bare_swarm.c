/*
 * The work of a step of the peers' workload and nothing else: what a program in C takes for it.
 *
 * Equal round robots drive about a rectangle with discs as obstacles. In each step
 *   1. robots are sorted by the cells of a uniform grid;
 *   2. each sensor of each robot reads the distance of the nearest part of a body within its sector, exactly, and
 *      which kind of body that is; robots and discs near enough to be touched are listed meanwhile;
 *   3. robots turn away from what is near (Avoid) or drive straight on (Explore);
 *   4. robots move along arcs, and are pushed apart, out of discs and back over the border until all are free, at
 *      most 32 times.
 *
 *     bare_swarm START UNTIMED TIMED [END]
 *
 * reads a start from a file, does UNTIMED steps and then TIMED ones, and prints the nanoseconds of processor time of a
 * timed step, and how many robots were in contact after it on average. END is a file for the readings of the last step
 * and the poses after it. `read_world` and `write_end` show what the files hold.
 */
#define _POSIX_C_SOURCE 199309L

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { NOTHING = -1, OBSTACLE = 0, ROBOT = 1 };

/* Of a constant number of sensors a compiler makes instructions for several at once. */
enum { MOST_SENSORS = 12, MOST_SWEEPS = 32 };

static const double PI = 3.14159265358979323846;
/* Overlaps below this share of the radius are rounding. */
static const double SLOP = 1e-7;
/* A sensor this near to a wall, in radii, touches it. */
static const double TOUCH = 1e-9;

typedef struct {
    double x, y;
} Vector;

/*
 * Where a sensor sits on its robot, the direction of its axis, half its field of view, and how far it sees: what the
 * start holds, and the same as arrays. Arrays are filled up with sensors of a range below 0. `wide` is infinite for a
 * sector of more than half a circle, which has no side to sort out, 0 for others.
 */
typedef struct {
    Vector mount, axis;
    double cos_half, sin_half, range;
} Sensor;

typedef struct {
    double mount_x[MOST_SENSORS], mount_y[MOST_SENSORS], axis_x[MOST_SENSORS], axis_y[MOST_SENSORS];
    double cos_half[MOST_SENSORS], sin_half[MOST_SENSORS], range[MOST_SENSORS], wide[MOST_SENSORS];
} Eyes;

typedef struct {
    double x, y, radius;
} Disc;

/*
 * `side` is the one to which a robot turns, 1 for left and -1 for right; `axis` is the direction of its heading, which
 * only turning robots compute anew; `number` is its row in the files, `cell` that in which it begins the step.
 */
typedef struct {
    double x, y, heading, side;
    Vector axis;
    int32_t number, cell;
} Robot;

typedef struct {
    double left, below, right, above;
} Rectangle;

/* Cells with a ring of empty ones about them, and what is in them: from start[k] to start[k + 1] what is in cell k. */
typedef struct {
    double left, below, per_unit;
    int32_t columns, rows, *start;
} Grid;

/* Two robots, or a robot and a disc, by their places in the arrays. */
typedef struct {
    int32_t robot, other;
} Pair;

typedef struct {
    Pair *items;
    int64_t count, room;
} Pairs;

typedef struct {
    int64_t robots, sensors, discs;
    int64_t front, left, right;
    Rectangle border;
    double radius, max_speed, near, reach;
    Sensor sensor[MOST_SENSORS];
    Eyes eyes;
    Disc *disc;
    Robot *robot, *unsorted;
    int32_t *listed;
    double *distance;
    int8_t *kind, *touched;
    Grid crowd, sight;
    Pairs close, beside;
} World;

static void stop(const char *reason)
{
    fprintf(stderr, "bare_swarm: %s\n", reason);
    exit(1);
}

static void *make_room(int64_t count, size_t size)
{
    void *room = calloc(count > 0 ? (size_t)count : 1, size);
    if (room == NULL)
        stop("there is not enough memory");
    return room;
}

static double larger(double a, double b)
{
    return a > b ? a : b;
}

static double smaller(double a, double b)
{
    return a < b ? a : b;
}

static double square(double number)
{
    return number * number;
}

/* ---- cells ---- */

static int32_t index_of(double offset, double per_unit, int32_t count)
{
    double index = offset * per_unit;
    if (!(index > 0.0))
        return 1;
    return index < count - 2 ? 1 + (int32_t)index : count - 2;
}

static int32_t column_of(const Grid *grid, double x)
{
    return index_of(x - grid->left, grid->per_unit, grid->columns);
}

static int32_t row_of(const Grid *grid, double y)
{
    return index_of(y - grid->below, grid->per_unit, grid->rows);
}

static Grid make_grid(Rectangle border, double side)
{
    Grid grid = {border.left, border.below, 1.0 / side, 2, 2, NULL};
    grid.columns += (int32_t)larger(ceil((border.right - border.left) / side), 1.0);
    grid.rows += (int32_t)larger(ceil((border.above - border.below) / side), 1.0);
    grid.start = make_room((int64_t)grid.columns * grid.rows + 2, sizeof(int32_t));
    return grid;
}

static void clear_counts(Grid *grid)
{
    memset(grid->start, 0, sizeof(int32_t) * ((size_t)grid->columns * (size_t)grid->rows + 2));
}

/*
 * Turn counts into places: before, start[k + 2] is how many items cell k has; afterwards start[k + 1] is where its
 * first item goes. Each item that is stored moves it on, to where the items of the next cell begin.
 */
static int32_t place_counts(Grid *grid)
{
    int32_t sum = 0, cells = grid->columns * grid->rows;
    for (int32_t k = 0; k <= cells + 1; k++)
        sum = grid->start[k] += sum;
    return sum;
}

static void sort_robots(World *world)
{
    Grid *grid = &world->crowd;
    Robot *before = world->robot;
    clear_counts(grid);
    for (int64_t p = 0; p < world->robots; p++) {
        before[p].cell = row_of(grid, before[p].y) * grid->columns + column_of(grid, before[p].x);
        grid->start[before[p].cell + 2]++;
    }
    place_counts(grid);
    for (int64_t p = 0; p < world->robots; p++)
        world->unsorted[grid->start[before[p].cell + 1]++] = before[p];
    world->robot = world->unsorted;
    world->unsorted = before;
}

/* List each disc in all cells from which it may be seen or touched. */
static void list_discs(World *world)
{
    Grid *grid = &world->sight;
    for (int storing = 0; storing < 2; storing++) {
        for (int32_t k = 0; k < world->discs; k++) {
            Disc disc = world->disc[k];
            double far = disc.radius + world->reach;
            int32_t last_row = row_of(grid, disc.y + far), last_column = column_of(grid, disc.x + far);
            for (int32_t row = row_of(grid, disc.y - far); row <= last_row; row++)
                for (int32_t column = column_of(grid, disc.x - far); column <= last_column; column++) {
                    int32_t cell = row * grid->columns + column;
                    if (storing)
                        world->listed[grid->start[cell + 1]++] = k;
                    else
                        grid->start[cell + 2]++;
                }
        }
        if (!storing)
            world->listed = make_room(place_counts(grid), sizeof(int32_t));
    }
}

static void add_pair(Pairs *pairs, int32_t robot, int32_t other)
{
    if (pairs->count == pairs->room) {
        pairs->room = 2 * pairs->room + 64;
        pairs->items = realloc(pairs->items, (size_t)pairs->room * sizeof(Pair));
        if (pairs->items == NULL)
            stop("there is not enough memory");
    }
    pairs->items[pairs->count].robot = robot;
    pairs->items[pairs->count++].other = other;
}

/* ---- sensors: distances from the origin, within a sector about the x axis ---- */

/* Return a vector as seen along an axis. */
static Vector turn_back(Vector way, Vector axis)
{
    Vector turned = {axis.x * way.x + axis.y * way.y, axis.x * way.y - axis.y * way.x};
    return turned;
}

static int is_in_sector(double x, double y, const Sensor *sensor)
{
    return fabs(y) * sensor->cos_half <= x * sensor->sin_half && (x >= 0.0 || sensor->cos_half < 0.0);
}

/* The distance of a disc: to its rim if its centre is in the sector, else along the edge of the sector on its side. */
static double distance_of_disc(double x, double y, double radius, const Sensor *sensor)
{
    double far = x * x + y * y;
    if (far <= radius * radius)
        return 0.0;
    if (is_in_sector(x, y, sensor))
        return sqrt(far) - radius;
    double along = x * sensor->cos_half + fabs(y) * sensor->sin_half;
    double across = x * sensor->sin_half - fabs(y) * sensor->cos_half;
    double inside = radius * radius - across * across;
    return along > 0.0 && inside >= 0.0 ? along - sqrt(inside) : INFINITY;
}

/*
 * The distance of a wall, whose foot is this far and in this direction: to its foot, or along the edge of the sector
 * that is nearer to it. All of the straight line counts: its part beyond a corner is behind another wall.
 */
static double distance_of_wall(double far, Vector way, const Sensor *sensor)
{
    if (is_in_sector(way.x, way.y, sensor))
        return far;
    double share = way.x * sensor->cos_half + fabs(way.y) * sensor->sin_half;
    return share > 0.0 ? far / share : INFINITY;
}

/* Note that a sensor sees a body, unless it sees another one that is nearer; of equally near ones the lower kind. */
static void note_reading(double distance, int8_t kind, double range, double *nearest, int8_t *nearest_kind)
{
    if (distance <= range && (distance < *nearest || (distance == *nearest && kind < *nearest_kind))) {
        *nearest = distance;
        *nearest_kind = kind;
    }
}

/*
 * Let the sensors of robot p look at a disc, which is this way from its centre. Most sensors look elsewhere: these are
 * sorted out for all of them at once, without branches.
 */
static void look_at_disc(World *world, int32_t p, Vector way, double radius, int8_t kind)
{
    const Eyes *eyes = &world->eyes;
    double *distance = world->distance + p * world->sensors;
    int8_t *kinds = world->kind + p * world->sensors;
    double x[MOST_SENSORS], y[MOST_SENSORS], outside[MOST_SENSORS];
    Vector place = turn_back(way, world->robot[p].axis);
    for (int s = 0; s < MOST_SENSORS; s++) {
        double ahead = place.x - eyes->mount_x[s], aside = place.y - eyes->mount_y[s];
        x[s] = eyes->axis_x[s] * ahead + eyes->axis_y[s] * aside;
        y[s] = eyes->axis_x[s] * aside - eyes->axis_y[s] * ahead;
        double beside = fabs(y[s]) * eyes->cos_half[s] - x[s] * eyes->sin_half[s] - radius - eyes->wide[s];
        double beyond = ahead * ahead + aside * aside - square(eyes->range[s] + radius);
        outside[s] = larger(beside, beyond);
    }
    for (int s = 0; s < world->sensors; s++)
        if (outside[s] <= 0.0) {
            double gap = distance_of_disc(x[s], y[s], radius, &world->sensor[s]);
            note_reading(gap, kind, eyes->range[s], &distance[s], &kinds[s]);
        }
}

/* Let the sensors of robot p look at a wall, whose foot is this far from its centre and in this direction. */
static void look_at_wall(World *world, int32_t p, double far, Vector direction)
{
    double *distance = world->distance + p * world->sensors;
    int8_t *kinds = world->kind + p * world->sensors;
    Vector way = turn_back(direction, world->robot[p].axis);
    for (int s = 0; s < world->sensors; s++) {
        const Sensor *sensor = &world->sensor[s];
        double gap = far - way.x * sensor->mount.x - way.y * sensor->mount.y;
        if (gap > sensor->range)
            continue;
        if (gap > TOUCH * world->radius)
            gap = distance_of_wall(gap, turn_back(way, sensor->axis), sensor);
        note_reading(larger(gap, 0.0), OBSTACLE, sensor->range, &distance[s], &kinds[s]);
    }
}

static void look_at_border(World *world, int32_t p)
{
    const Robot *robot = &world->robot[p];
    Rectangle r = world->border;
    double far[4] = {robot->x - r.left, r.right - robot->x, robot->y - r.below, r.above - robot->y};
    Vector direction[4] = {{-1.0, 0.0}, {1.0, 0.0}, {0.0, -1.0}, {0.0, 1.0}};
    for (int k = 0; k < 4; k++)
        if (far[k] <= world->reach)
            look_at_wall(world, p, far[k], direction[k]);
}

static void look_at_discs(World *world, int32_t p)
{
    const Robot *robot = &world->robot[p];
    const int32_t *start = world->sight.start + robot->cell;
    for (int32_t item = start[0]; item < start[1]; item++) {
        Disc disc = world->disc[world->listed[item]];
        Vector way = {disc.x - robot->x, disc.y - robot->y};
        double far = way.x * way.x + way.y * way.y;
        if (far < square(2.0 * world->radius + disc.radius))
            add_pair(&world->beside, p, world->listed[item]);
        if (far <= square(world->reach + disc.radius))
            look_at_disc(world, p, way, disc.radius, OBSTACLE);
    }
}

/* Let robot p and those from `first` on, up to `end`, look at each other. */
static void look_at_each_other(World *world, int32_t p, int32_t first, int32_t end)
{
    const Robot *robot = world->robot;
    double sight = square(world->reach + world->radius), touch = square(3.0 * world->radius);
    for (int32_t q = first; q < end; q++) {
        Vector way = {robot[q].x - robot[p].x, robot[q].y - robot[p].y}, back = {-way.x, -way.y};
        double far = way.x * way.x + way.y * way.y;
        if (far > sight)
            continue;
        look_at_disc(world, p, way, world->radius, ROBOT);
        look_at_disc(world, q, back, world->radius, ROBOT);
        if (far < touch)
            add_pair(&world->close, p, q);
    }
}

/* Let robot p and those that come after it in its cell, the next one and three of the next row see each other. */
static void look_at_robots(World *world, int32_t p)
{
    const int32_t *start = world->crowd.start + world->robot[p].cell, *above = start + world->crowd.columns;
    look_at_each_other(world, p, p + 1, start[2]);
    look_at_each_other(world, p, above[-1], above[2]);
}

/* Write the readings of all robots, -1 where nothing is seen. */
static void sense(World *world)
{
    int64_t count = world->robots * world->sensors;
    world->close.count = world->beside.count = 0;
    for (int64_t k = 0; k < count; k++) {
        world->distance[k] = INFINITY;
        world->kind[k] = NOTHING;
    }
    for (int32_t p = 0; p < world->robots; p++) {
        look_at_border(world, p);
        look_at_discs(world, p);
        look_at_robots(world, p);
    }
    for (int64_t k = 0; k < count; k++)
        world->distance[k] = world->distance[k] < INFINITY ? world->distance[k] : -1.0;
}

/* ---- control and motion ---- */

static int is_near(const World *world, const double *distance, int64_t sensor)
{
    return sensor >= 0 && distance[sensor] >= 0.0 && distance[sensor] < world->near;
}

/* Return the side to which a robot turns, 0 for none: the last of front, left and right that sees something near. */
static double choose_side(const World *world, const double *distance, double own_side)
{
    if (is_near(world, distance, world->right))
        return 1.0;
    if (is_near(world, distance, world->left))
        return -1.0;
    return is_near(world, distance, world->front) ? own_side : 0.0;
}

static Vector direction_of(double heading)
{
    Vector axis = {cos(heading), sin(heading)};
    return axis;
}

static double wrap(double heading)
{
    return heading >= PI || heading < -PI ? heading - 2.0 * PI * floor((heading + PI) / (2.0 * PI)) : heading;
}

/* Move a robot straight on, or, turning, along the arc of one wheel at full speed while the other one stands still. */
static void drive(const World *world, Robot *robot, double side)
{
    double speed = world->max_speed;
    Vector way = robot->axis;
    if (side != 0.0 && speed > 0.0) {
        double turn = side * speed / (2.0 * world->radius);
        speed *= sin(turn / 2.0) / turn;
        way = direction_of(robot->heading + turn / 2.0);
        robot->heading = wrap(robot->heading + turn);
        robot->axis = direction_of(robot->heading);
    }
    robot->x += speed * way.x;
    robot->y += speed * way.y;
}

/* ---- contact ---- */

/* Move a robot that is beyond the border back over it. */
static void keep_inside(World *world, int32_t p)
{
    Rectangle r = world->border;
    Robot *robot = &world->robot[p];
    double x = smaller(larger(robot->x, r.left + world->radius), r.right - world->radius);
    double y = smaller(larger(robot->y, r.below + world->radius), r.above - world->radius);
    world->touched[p] |= x != robot->x || y != robot->y;
    robot->x = x;
    robot->y = y;
}

/* Push robots out of the discs near them, and return whether any overlapped one. */
static int push_from_discs(World *world)
{
    int pushed = 0;
    for (int64_t k = 0; k < world->beside.count; k++) {
        Pair pair = world->beside.items[k];
        Robot *robot = &world->robot[pair.robot];
        Disc disc = world->disc[pair.other];
        double dx = robot->x - disc.x, dy = robot->y - disc.y, apart = world->radius + disc.radius;
        double far = dx * dx + dy * dy;
        if (far >= square(apart - SLOP * world->radius))
            continue;
        double scale = apart / sqrt(far);
        robot->x = disc.x + scale * dx;
        robot->y = disc.y + scale * dy;
        world->touched[pair.robot] = 1;
        keep_inside(world, pair.robot);
        pushed = 1;
    }
    return pushed;
}

/* Push robots that overlap apart, half the overlap each, and return whether any did. */
static int push_apart(World *world)
{
    int pushed = 0;
    double apart = 2.0 * world->radius;
    for (int64_t k = 0; k < world->close.count; k++) {
        Pair pair = world->close.items[k];
        Robot *a = &world->robot[pair.robot], *b = &world->robot[pair.other];
        double dx = b->x - a->x, dy = b->y - a->y, far = dx * dx + dy * dy;
        if (far >= square(apart - SLOP * world->radius))
            continue;
        double gap = sqrt(far), push = gap > 0.0 ? (apart - gap) / (2.0 * gap) : 0.0;
        a->x -= push * dx;
        a->y -= push * dy;
        b->x += push * dx;
        b->y += push * dy;
        world->touched[pair.robot] = 1;
        world->touched[pair.other] = 1;
        keep_inside(world, pair.robot);
        keep_inside(world, pair.other);
        pushed = 1;
    }
    return pushed;
}

static void resolve_contacts(World *world)
{
    int pushed = 1;
    for (int sweep = 0; pushed && sweep < MOST_SWEEPS; sweep++) {
        pushed = push_from_discs(world);
        pushed |= push_apart(world);
    }
}

/* Take a step, and return how many robots were in contact. */
static int64_t take_step(World *world)
{
    int64_t contacts = 0;
    sort_robots(world);
    sense(world);
    memset(world->touched, 0, (size_t)world->robots);
    for (int32_t p = 0; p < world->robots; p++) {
        Robot *robot = &world->robot[p];
        drive(world, robot, choose_side(world, world->distance + p * world->sensors, robot->side));
        keep_inside(world, p);
    }
    resolve_contacts(world);
    for (int64_t p = 0; p < world->robots; p++)
        contacts += world->touched[p];
    return contacts;
}

/* ---- files ---- */

static void read_items(FILE *file, void *items, size_t size, int64_t count)
{
    if (fread(items, size, (size_t)count, file) != (size_t)count)
        stop("the start ends too early");
}

/*
 * Read a start. As 64-bit integers the numbers of robots, sensors and discs, and which sensors are the front, left and
 * right one, -1 for none. Then as doubles the border (left, below, right, above); a robot's radius and max_speed, and
 * the distance that is near; each sensor, as in `Sensor`; each disc (x, y, radius); each robot (x, y, heading, side).
 */
static void read_world(World *world, const char *path)
{
    int64_t counts[6];
    double sizes[7];
    FILE *file = fopen(path, "rb");
    if (file == NULL)
        stop("the start cannot be read");
    read_items(file, counts, sizeof(int64_t), 6);
    world->robots = counts[0], world->sensors = counts[1], world->discs = counts[2];
    world->front = counts[3], world->left = counts[4], world->right = counts[5];
    read_items(file, sizes, sizeof(double), 7);
    world->border = (Rectangle){sizes[0], sizes[1], sizes[2], sizes[3]};
    world->radius = sizes[4], world->max_speed = sizes[5], world->near = sizes[6];
    if (world->sensors > MOST_SENSORS)
        stop("a robot has more than 12 sensors");
    read_items(file, world->sensor, sizeof(Sensor), world->sensors);
    world->disc = make_room(world->discs, sizeof(Disc));
    read_items(file, world->disc, sizeof(Disc), world->discs);
    world->robot = make_room(world->robots, sizeof(Robot));
    for (int64_t p = 0; p < world->robots; p++) {
        read_items(file, &world->robot[p], sizeof(double), 4);
        world->robot[p].axis = direction_of(world->robot[p].heading);
        world->robot[p].number = (int32_t)p;
    }
    fclose(file);
}

/* Write the sensors as arrays, and find how far from its centre a robot sees, or may be moved to touch others. */
static void prepare_sensors(World *world)
{
    Eyes *eyes = &world->eyes;
    world->reach = 2.0 * world->radius;
    for (int64_t s = 0; s < MOST_SENSORS; s++) {
        Sensor none = {{0.0, 0.0}, {1.0, 0.0}, 1.0, 0.0, -1.0};
        Sensor sensor = s < world->sensors ? world->sensor[s] : none;
        eyes->mount_x[s] = sensor.mount.x, eyes->mount_y[s] = sensor.mount.y;
        eyes->axis_x[s] = sensor.axis.x, eyes->axis_y[s] = sensor.axis.y;
        eyes->cos_half[s] = sensor.cos_half, eyes->sin_half[s] = sensor.sin_half;
        eyes->range[s] = sensor.range, eyes->wide[s] = sensor.cos_half < 0.0 ? INFINITY : 0.0;
        world->reach = larger(world->reach, hypot(sensor.mount.x, sensor.mount.y) + sensor.range);
    }
}

static void prepare(World *world)
{
    prepare_sensors(world);
    world->unsorted = make_room(world->robots, sizeof(Robot));
    world->distance = make_room(world->robots * world->sensors, sizeof(double));
    world->kind = make_room(world->robots * world->sensors, 1);
    world->touched = make_room(world->robots, 1);
    /* Robots that see or may touch each other are in neighbouring cells. */
    world->crowd = make_grid(world->border, world->reach + world->radius);
    world->sight = make_grid(world->border, world->reach + world->radius);
    list_discs(world);
}

/* Write the readings (n, s), kinds (n, s) and poses (n, 3: x, y, heading) as doubles, in the order of the start. */
static void write_end(const World *world, const char *path)
{
    int64_t n = world->robots, s = world->sensors;
    double *numbers = make_room(n * (2 * s + 3), sizeof(double));
    for (int64_t p = 0; p < n; p++) {
        int64_t row = world->robot[p].number;
        for (int64_t k = 0; k < s; k++) {
            numbers[row * s + k] = world->distance[p * s + k];
            numbers[(n + row) * s + k] = world->kind[p * s + k];
        }
        double *pose = numbers + 2 * n * s + 3 * row;
        pose[0] = world->robot[p].x, pose[1] = world->robot[p].y, pose[2] = world->robot[p].heading;
    }
    FILE *file = fopen(path, "wb");
    size_t count = (size_t)(n * (2 * s + 3));
    if (file == NULL || fwrite(numbers, sizeof(double), count, file) != count || fclose(file) != 0)
        stop("the end cannot be written");
    free(numbers);
}

static double processor_nanoseconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return 1e9 * (double)now.tv_sec + (double)now.tv_nsec;
}

int main(int count, char **words)
{
    static World world;
    if (count < 4 || count > 5)
        stop("expected START UNTIMED TIMED [END]");
    long untimed = atol(words[2]), timed = atol(words[3]);
    read_world(&world, words[1]);
    prepare(&world);
    for (long k = 0; k < untimed; k++)
        take_step(&world);
    int64_t contacts = 0;
    double begin = processor_nanoseconds();
    for (long k = 0; k < timed; k++)
        contacts += take_step(&world);
    double end = processor_nanoseconds();
    printf("%.17g %.17g\n", (end - begin) / (double)timed, (double)contacts / (double)timed);
    if (count == 5)
        write_end(&world, words[4]);
    return 0;
}
