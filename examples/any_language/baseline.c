/* The six-state baseline: ./baseline recording.csv out.csv; build: cc -O2 -o baseline baseline.c -lm */
#include <math.h>
#include <stdio.h>
#include <string.h>
static char header[16384] = ",", line[16384] = ","; /* so that a comma stands before every cell */
#define AXIS(name, i) {"attitude_accel_" name "_mps2", "position_" name "_m", "velocity_" name "_mps", \
                       "position_variance_" i "_m2", "velocity_variance_" i "_m2ps2"}
static const char *COLUMNS[3][5] = {AXIS("east", "11"), AXIS("north", "22"), AXIS("up", "33")};
static double get(const char *key) { /* the value in this line; NaN where the cell is empty */
    double value = NAN;
    for (char *name = header, *cell = line; name && cell; name = strchr(name + 1, ','), cell = strchr(cell + 1, ','))
        if (!strncmp(name + 1, key, strlen(key)) && strchr(",\r\n", name[1 + strlen(key)])) sscanf(cell, ",%lf", &value);
    return value;
}
int main(int argc, char **argv) {
    FILE *in = argc == 3 ? fopen(argv[1], "r") : NULL, *out = in ? fopen(argv[2], "w") : NULL;
    if (!out || !fgets(header + 1, sizeof header - 1, in)) return fputs("usage: baseline IN.csv OUT.csv\n", stderr), 2;
    double x[3][2] = {{0}}, P[3][2][2] = {{{0}}}, u[3] = {0}, t = 0, sigma_a = 0.2; /* of one sample of u [m/s2] */
    fputs("t_s,east_m,north_m,up_m,east_mps,north_mps,up_mps\n", out);
    for (int begun = 0; fgets(line + 1, sizeof line - 1, in);) {
        const double dt = get("t_s") - t, b[2] = {0.5 * dt * dt, dt};
        for (int k = 0; k < 3; k++) { /* each axis: predict with the mean over the interval that ends here */
            if (!isnan(get(COLUMNS[k][0]))) u[k] = get(COLUMNS[k][0]);
            x[k][0] += x[k][1] * dt + b[0] * u[k], x[k][1] += b[1] * u[k];
            P[k][0][0] += dt * (2 * P[k][0][1] + dt * P[k][1][1]), P[k][0][1] = P[k][1][0] += dt * P[k][1][1];
            for (int i = 0; i < 4; i++) P[k][i / 2][i % 2] += sigma_a * sigma_a * b[i / 2] * b[i % 2];
            for (int m = 0; m < 2; m++) { /* update with the position, then with the velocity */
                const double z = get(COLUMNS[k][1 + m]), R = get(COLUMNS[k][3 + m]), S = P[k][m][m] + R;
                const double y = z - x[k][m], K[2] = {P[k][0][m] / S, P[k][1][m] / S};
                if (!begun) x[k][m] = z, P[k][m][m] = R, P[k][m][1 - m] = 0;
                if (!begun || isnan(z)) continue;
                for (int i = 0; i < 2; i++) x[k][i] += K[i] * y, P[k][i][0] -= K[i] * K[0] * S, P[k][i][1] -= K[i] * K[1] * S;
            }
        }
        begun |= !isnan(get("position_east_m") + get("velocity_east_mps")), t += dt;
        if (begun && get("evaluated") == 1)
            fprintf(out, "%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f\n", t, x[0][0], x[1][0], x[2][0], x[0][1], x[1][1], x[2][1]);
    }
    return fclose(out) != 0;
}
