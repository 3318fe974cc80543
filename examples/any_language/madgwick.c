/* Madgwick's attitude filter: ./madgwick recording.csv out.csv; build: cc -O2 -o madgwick madgwick.c -lm
   SI units; the body is forward, left, up; at rest the accelerometer shows +g upwards. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
enum { COLUMNS = 7 };
static const double BETA = 0.033; /* 1/s: the rate of the correction, of the paper */
static const char *NAMES[COLUMNS] = {"t_s", "gyro_forward_radps", "gyro_left_radps", "gyro_up_radps",
                                     "accel_forward_mps2", "accel_left_mps2", "accel_up_mps2"};
static void level(double q[4], const double y[3]) { /* a body at rest that feels y; its heading is 0 */
    const double roll = atan2(y[1], y[2]) / 2, pitch = atan2(-y[0], hypot(y[1], y[2])) / 2;
    q[0] = cos(roll) * cos(pitch), q[1] = sin(roll) * cos(pitch);
    q[2] = cos(roll) * sin(pitch), q[3] = -sin(roll) * sin(pitch);
}
static void step(double q[4], const double g[3], const double y[3], double dt) { /* q turns the body into the world */
    const double w = q[0], a = q[1], b = q[2], c = q[3], norm = sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2]);
    const double rate[4] = {-a * g[0] - b * g[1] - c * g[2], w * g[0] + b * g[2] - c * g[1],
                            w * g[1] - a * g[2] + c * g[0], w * g[2] + a * g[1] - b * g[0]};
    const double f[3] = {2 * (a * c - w * b) - y[0] / norm, 2 * (w * a + b * c) - y[1] / norm,
                         1 - 2 * (a * a + b * b) - y[2] / norm};
    const double slope[4] = {-2 * b * f[0] + 2 * a * f[1], 2 * c * f[0] + 2 * w * f[1] - 4 * a * f[2],
                             -2 * w * f[0] + 2 * c * f[1] - 4 * b * f[2], 2 * a * f[0] + 2 * b * f[1]};
    double length = 1e-30, size = 0;
    for (int k = 0; k < 4; k++) length += slope[k] * slope[k];
    for (int k = 0; k < 4; k++) q[k] += dt * (rate[k] / 2 - BETA * slope[k] / sqrt(length)), size += q[k] * q[k];
    for (int k = 0; k < 4; k++) q[k] /= sqrt(size);
}
int main(int argc, char **argv) {
    char line[16384], *rest = line, *cell;
    int place[COLUMNS] = {0}, begun = 0;
    double q[4], v[COLUMNS], before = 0;
    FILE *in = argc == 3 ? fopen(argv[1], "r") : NULL, *out = in ? fopen(argv[2], "w") : NULL;
    if (!out || !fgets(line, sizeof line, in)) return fputs("usage: madgwick IN.csv OUT.csv\n", stderr), 2;
    for (int k = 0; (cell = strsep(&rest, ",\r\n")); k++)
        for (int i = 0; i < COLUMNS; i++)
            if (!strcmp(cell, NAMES[i])) place[i] = k;
    fputs("t_s,qw,qx,qy,qz\n", out);
    for (; fgets(line, sizeof line, in); begun = 1, before = v[0]) {
        rest = line;
        for (int k = 0; (cell = strsep(&rest, ",\r\n")); k++)
            for (int i = 0; i < COLUMNS; i++)
                if (place[i] == k) v[i] = atof(cell);
        if (!begun) level(q, v + 4);
        step(q, v + 1, v + 4, begun ? v[0] - before : 0);
        fprintf(out, "%.9f,%.15f,%.15f,%.15f,%.15f\n", v[0], q[0], q[1], q[2], q[3]);
    }
    return fclose(out) != 0;
}
