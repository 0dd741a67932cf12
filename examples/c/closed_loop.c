/* The controller holds the simulated arm on its belt, from C.

       cargo build --release --package painleve-c-abi
       cc -std=c99 examples/c/closed_loop.c -I sil-host/c-abi/include -L target/release \
           -Wl,-rpath,$PWD/target/release -lpainleve_c -lm -o closed_loop && ./closed_loop */
#include <math.h>
#include <stdio.h>

#include "painleve.h"

#define TICKS 6000

static const char SCENARIO[] =
    "[run]\n"
    "tick_hz = 1000\n"
    "[controller]\n"
    "reference = [{ minimum-jerk = { target_m = 0.148, duration_s = 3.0 } }]\n";

static int failed(const char *what)
{
    fprintf(stderr, "%s: %s\n", what, painleve_last_error());
    return 1;
}

int main(void)
{
    PainleveController *controller = NULL;
    PainlevePlant *plant = NULL;
    PainleveSnapshot end;

    /* An invalid call has an error message. */
    if (painleve_plant_new("belt.friction = -1", &plant) == PAINLEVE_STATUS_OK) {
        fprintf(stderr, "negative friction has been accepted\n");
        return 1;
    }
    printf("refused: %s\n", painleve_last_error());

    if (painleve_controller_new(SCENARIO, &controller) != PAINLEVE_STATUS_OK)
        return failed("controller");
    if (painleve_plant_new(SCENARIO, &plant) != PAINLEVE_STATUS_OK)
        return failed("plant");
    for (int tick = 0; tick < TICKS; tick++) {
        PainleveSensorFrame sensor;
        PainleveActuatorFrame actuator;
        bool is_lost;
        if (painleve_plant_sample(plant, &sensor, &is_lost) != PAINLEVE_STATUS_OK)
            return failed("sample");
        if (!is_lost
            && painleve_controller_tick(controller, &sensor, &actuator) != PAINLEVE_STATUS_OK)
            return failed("tick");
        if (painleve_plant_advance(plant, is_lost ? NULL : &actuator) != PAINLEVE_STATUS_OK)
            return failed("advance");
    }
    if (painleve_plant_snapshot(plant, &end) != PAINLEVE_STATUS_OK)
        return failed("snapshot");
    printf("tip at %.5f m, normal force %.2f N\n", end.tip_t_m, end.normal_force_n);
    painleve_plant_free(plant);
    painleve_controller_free(controller);
    return fabs(end.tip_t_m - 0.148) < 1e-3 ? 0 : 1;
}
