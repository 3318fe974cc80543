/* The six-state baseline: ./baseline recording.csv out.csv [sigma_a]; build: cc -O2 -o baseline baseline.c -lm */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
static char header[16384], line[16384], *names[64], *cells[64];
static const char *INPUT[] = {"attitude_accel_east_mps2", "attitude_accel_north_mps2", "attitude_accel_up_mps2"};
static const char *MEASURED[3][2] = {{"position_east_m", "velocity_east_mps"},
    {"position_north_m", "velocity_north_mps"}, {"position_up_m", "velocity_up_mps"}};
static const char *VARIANCE[3][2] = {{"position_variance_11_m2", "velocity_variance_11_m2ps2"},
    {"position_variance_22_m2", "velocity_variance_22_m2ps2"}, {"position_variance_33_m2", "velocity_variance_33_m2ps2"}};

static void split(char *text, char **into) { /* empty cells stay: streams without a value at this time */
    for (int k = 0; k < 64; k++) into[k] = strsep(&text, ",\r\n");
}
static double get(const char *column) { /* NaN where there is no value */
    for (int k = 0; k < 64 && names[k]; k++)
        if (!strcmp(names[k], column)) return cells[k] && *cells[k] ? atof(cells[k]) : NAN;
    return NAN;
}
int main(int argc, char **argv) {
    const double sigma_a = argc > 3 ? atof(argv[3]) : 0.2; /* noise of one sample of the acceleration [m/s2] */
    FILE *in = argc > 2 ? fopen(argv[1], "r") : NULL, *out = in ? fopen(argv[2], "w") : NULL;
    if (!out || !fgets(header, sizeof header, in)) return fputs("usage: baseline recording.csv out.csv\n", stderr), 2;
    double x[3][2] = {{0}}, P[3][2][2] = {{{0}}}, u[3] = {0}, t = 0;
    int begun = 0;
    split(header, names);
    fputs("t_s,east_m,north_m,up_m,east_mps,north_mps,up_mps\n", out);
    while (fgets(line, sizeof line, in)) {
        split(line, cells);
        const double dt = get("t_s") - t, fix = get("position_east_m") + get("velocity_east_mps");
        for (int k = 0; k < 3; k++) {
            if (!isnan(get(INPUT[k]))) u[k] = get(INPUT[k]); /* the mean over the interval that ends here */
            const double b[2] = {0.5 * dt * dt, dt};
            x[k][0] += x[k][1] * dt + b[0] * u[k], x[k][1] += b[1] * u[k];
            P[k][0][0] += dt * (P[k][0][1] + P[k][1][0] + dt * P[k][1][1]);
            P[k][0][1] += dt * P[k][1][1], P[k][1][0] = P[k][0][1];
            for (int i = 0; i < 4; i++) P[k][i / 2][i % 2] += sigma_a * sigma_a * b[i / 2] * b[i % 2];
            for (int m = 0; m < 2; m++) { /* position, then velocity */
                const double z = get(MEASURED[k][m]), R = get(VARIANCE[k][m]);
                if (!begun) x[k][m] = z, P[k][m][m] = R, P[k][m][1 - m] = 0;
                if (!begun || isnan(z)) continue;
                const double S = P[k][m][m] + R, y = z - x[k][m], h[2] = {P[k][0][m], P[k][1][m]};
                for (int i = 0; i < 2; i++) x[k][i] += h[i] / S * y;
                for (int i = 0; i < 4; i++) P[k][i / 2][i % 2] -= h[i / 2] * h[i % 2] / S;
            }
        }
        begun |= !isnan(fix), t += dt;
        if (begun && get("evaluated") == 1)
            fprintf(out, "%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f\n", t, x[0][0], x[1][0], x[2][0], x[0][1], x[1][1], x[2][1]);
    }
    return fclose(out) != 0;
}
