/* The arm for Siconos: mass, internal forces, and the tip over the moving belt. */
#include <math.h>

#define M 0.12
#define L 0.21
#define K 1.3
#define SIGMA 0.005
#define ALPHA0 (13.72 * 3.14159265358979323846 / 180.0)
#define H 0.3775
#define G 9.81
#define V_BELT (-0.4)

/* M(q), by columns. */
void mass(unsigned int n, double *q, double *m, unsigned int size, double *z) {
  double coupling = 0.5 * M * L * L * cos(q[1] - q[0]);
  m[0] = 4.0 / 3.0 * M * L * L;
  m[1] = m[2] = coupling;
  m[3] = M * L * L / 3.0;
}

/* w and c on the left-hand side. */
void internal(double time, unsigned int n, double *q, double *v, double *f, unsigned int size, double *z) {
  double spring = K * (q[1] - q[0] + ALPHA0), c = 0.5 * M * L * L * sin(q[0] - q[1]);
  f[0] = 1.5 * M * G * L * sin(q[0]) - spring - SIGMA * (v[1] - 2 * v[0]) + c * v[1] * v[1];
  f[1] = 0.5 * M * G * L * sin(q[1]) + spring + SIGMA * (v[1] - v[0]) - c * v[0] * v[0];
}

/* Gap, and the way along the belt. */
void gap(unsigned int n, double *q, double time, unsigned int m, double *y, unsigned int size, double *z) {
  y[0] = H - L * (cos(q[0]) + cos(q[1]));
  y[1] = L * (sin(q[0]) + sin(q[1])) - V_BELT * time;
}

/* Their derivatives to q, by columns. */
void gap_q(unsigned int n, double *q, double time, unsigned int m, double *j, unsigned int size, double *z) {
  j[0] = L * sin(q[0]);
  j[1] = L * cos(q[0]);
  j[2] = L * sin(q[1]);
  j[3] = L * cos(q[1]);
}

/* And to time. */
void gap_t(unsigned int n, double *q, double time, unsigned int m, double *y, unsigned int size, double *z) {
  y[0] = 0;
  y[1] = -V_BELT;
}
