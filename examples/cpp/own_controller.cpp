/* A user-defined controller in C++: holds both joints of the simulated arm at their initial angles and presses
   the tip on the belt. The plant, its encoders and its torque stages come from the C library.

       cargo build --release --package painleve-c-abi
       g++ -std=c++17 examples/cpp/own_controller.cpp -I sil-host/c-abi/include -L target/release \
           -Wl,-rpath,$PWD/target/release -lpainleve_c -o own_controller && ./own_controller */
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <stdexcept>

#include "painleve.h"

namespace {

constexpr double kPi = 3.141592653589793;
// The default scenario's converters: 14-bit encoders, 12-bit torque stages of ±5 N·m.
constexpr double kRadPerCount = 2.0 * kPi / (1 << 14);
constexpr double kCountsPerNm = (1 << 11) / 5.0;
constexpr double kTickS = 1e-3;
constexpr int kTicks = 2000;
constexpr std::uint32_t kEnable = 1;
constexpr std::uint8_t kIdle = 0, kTracking = 2;

void check(PainleveStatus status)
{
    if (status != PAINLEVE_STATUS_OK) throw std::runtime_error(painleve_last_error());
}

struct FreePlant {
    void operator()(PainlevePlant *plant) const { painleve_plant_free(plant); }
};
using Plant = std::unique_ptr<PainlevePlant, FreePlant>;

Plant make_plant(const char *scenario)
{
    PainlevePlant *plant = nullptr;
    check(painleve_plant_new(scenario, &plant));
    return Plant(plant);
}

// Spring and damper to the first angles, with a constant torque that presses the tip on the belt.
class JointSprings {
public:
    PainleveActuatorFrame tick(const PainleveSensorFrame &sensor)
    {
        constexpr double kStiffnessNmRad = 20.0, kDampingNmsRad = 0.4;
        constexpr std::array<double, 2> kPressingNm = {0.5, 0.8};
        PainleveActuatorFrame answer{};
        answer.tick = sensor.tick;
        answer.sequence = sensor.sequence;
        answer.state = sensor.inputs & kEnable ? kTracking : kIdle;
        for (std::size_t joint = 0; joint < 2; joint++) {
            const double now = std::remainder(sensor.joints[joint] * kRadPerCount, 2.0 * kPi);
            if (is_first_) start_[joint] = before_[joint] = now;
            const double rate = (now - before_[joint]) / kTickS;
            const double torque_nm = kPressingNm[joint] + kStiffnessNmRad * (start_[joint] - now) - kDampingNmsRad * rate;
            const long counts = std::lround(torque_nm * kCountsPerNm);
            if (answer.state == kTracking) answer.torques[joint] = static_cast<std::int32_t>(std::clamp(counts, -2048L, 2047L));
            before_[joint] = now;
        }
        is_first_ = false;
        return answer;
    }

private:
    bool is_first_ = true;
    std::array<double, 2> start_{}, before_{};
};

} // namespace

int main()
try {
    const Plant plant = make_plant("[run]\ntick_hz = 1000\n");
    JointSprings controller;
    PainleveSnapshot now{};
    double highest_gap_m = 0.0;
    for (int tick = 0; tick < kTicks; tick++) {
        PainleveSensorFrame sensor;
        bool is_lost = false;
        check(painleve_plant_sample(plant.get(), &sensor, &is_lost));
        const PainleveActuatorFrame answer = controller.tick(sensor);
        check(painleve_plant_advance(plant.get(), is_lost ? nullptr : &answer));
        check(painleve_plant_snapshot(plant.get(), &now));
        highest_gap_m = std::max(highest_gap_m, now.gap_m);
    }
    std::printf("tip at %.5f m, normal force %.2f N, highest gap %.1e m\n", now.tip_t_m, now.normal_force_n, highest_gap_m);
    return highest_gap_m < 1e-6 && now.normal_force_n > 0.0 ? 0 : 1;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
