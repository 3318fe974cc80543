// The filter loop of KF-GINS over samples that lie in memory: what the comparison in drive.py times.
//
// kf_gins_loop OPTIONS IMU GNSS OUT, files of doubles. OPTIONS has initial position [rad, rad, m], velocity [m/s] and
// roll, pitch, yaw [rad], their deviations, and the noises of the IMU as drive.py writes them; a row of IMU has time,
// three rotations, three changes of velocity; one of GNSS time, latitude, longitude, height, three deviations. OUT gets
// a row of time, latitude, longitude, height for each sample. Prints the processor's seconds of the fastest of five runs.

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <iostream>
#include <limits>
#include <vector>

#include "kf-gins/gi_engine.h"

using Numbers = std::vector<double>;

static Numbers numbers(const char *path) {
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    Numbers read(static_cast<size_t>(file.tellg()) / sizeof(double));
    file.seekg(0);
    file.read(reinterpret_cast<char *>(read.data()), static_cast<std::streamsize>(read.size() * sizeof(double)));
    return read;
}

static Eigen::Vector3d three(const double *first) { return {first[0], first[1], first[2]}; }

static GINSOptions options_of(const Numbers &n) {
    GINSOptions options;
    const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
    options.initstate = {three(&n[0]), three(&n[3]), three(&n[6]), {zero, zero, zero, zero}};
    options.initstate_std = {three(&n[9]), three(&n[12]), three(&n[15]),
                             {three(&n[24]), three(&n[27]), three(&n[30]), three(&n[33])}};
    options.imunoise = {three(&n[18]), three(&n[21]), three(&n[24]), three(&n[27]), three(&n[30]), three(&n[33]), n[36]};
    return options;
}

static GNSS fix_of(const double *row) { return {row[0], three(row + 1), three(row + 4), true}; }

static double run(GINSOptions options, const std::vector<IMU> &samples, const Numbers &gnss, Numbers &out) {
    GIEngine engine(options);
    size_t fix = 0;
    const std::clock_t begin = std::clock();
    engine.addImuData(samples[0], true);
    engine.addGnssData(fix_of(&gnss[0]));
    for (size_t k = 1; k < samples.size(); ++k) {
        if (gnss[7 * fix] < samples[k - 1].time && 7 * (fix + 1) < gnss.size()) {
            engine.addGnssData(fix_of(&gnss[7 * ++fix]));
        }
        engine.addImuData(samples[k]);
        engine.newImuProcess();
        const NavState state = engine.getNavState();
        const double row[4] = {engine.timestamp(), state.pos[0], state.pos[1], state.pos[2]};
        std::copy(row, row + 4, &out[4 * (k - 1)]);
    }
    return static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
}

int main(int, char *arguments[]) {
    const Numbers imu = numbers(arguments[2]), gnss = numbers(arguments[3]);
    std::vector<IMU> samples;
    for (size_t k = 7; k < imu.size(); k += 7) {
        const double *row = &imu[k];
        samples.push_back({row[0], row[0] - row[-7], three(row + 1), three(row + 4), 0.0});
    }
    Numbers out(4 * (samples.size() - 1));
    const GINSOptions options = options_of(numbers(arguments[1]));
    std::cout.setstate(std::ios::failbit);  // it prints its options
    double fastest = std::numeric_limits<double>::infinity();
    for (int round = 0; round < 5; ++round) {
        fastest = std::min(fastest, run(options, samples, gnss, out));
    }
    std::printf("%.9f\n", fastest);
    std::ofstream file(arguments[4], std::ios::binary);
    file.write(reinterpret_cast<const char *>(out.data()), static_cast<std::streamsize>(out.size() * sizeof(double)));
}
