/* A UMAT that writes all its inputs to STATEV. Its stress needs them: it adds Hooke's stress of DSTRAN to STRESS, which is turned by DROT. */
#include <string.h>

typedef double real;

static int put(real *statev, int at, const real *values, int count) {
  memcpy(statev + at, values, count * sizeof(real));
  return at + count;
}

static int put_number(real *statev, int at, real value) { return put(statev, at, &value, 1); }

void umat_(real *stress, real *statev, real *ddsdde, real *sse, real *spd, real *scd, real *rpl, real *ddsddt, real *drplde,
           real *drpldt, const real *stran, const real *dstran, const real *time, const real *dtime, const real *temp,
           const real *dtemp, const real *predef, const real *dpred, const char *cmname, const int *ndi, const int *nshr,
           const int *ntens, const int *nstatv, const real *props, const int *nprops, const real *coords, const real *drot,
           real *pnewdt, const real *celent, const real *dfgrd0, const real *dfgrd1, const int *noel, const int *npt,
           const int *layer, const int *kspt, const int *jstep, const int *kinc, size_t cmname_length) {
  const int n = *ntens;
  int at = put_number(statev, 0, statev[0] + 1);
  at = put(statev, at, stress, n);
  at = put(statev, at, stran, n);
  at = put(statev, at, dstran, n);
  at = put(statev, at, time, 2);
  at = put(statev, at, dtime, 1);
  at = put(statev, at, temp, 1);
  at = put(statev, at, dtemp, 1);
  at = put(statev, at, predef, 1);
  at = put(statev, at, dpred, 1);
  at = put(statev, at, props, *nprops);
  at = put(statev, at, coords, 3);
  at = put(statev, at, drot, 9);
  at = put(statev, at, celent, 1);
  at = put(statev, at, dfgrd0, 9);
  at = put(statev, at, dfgrd1, 9);
  const int counts[] = {*ndi, *nshr, *ntens, *nstatv, *nprops, *noel, *npt, *layer, *kspt};
  for (int i = 0; i < 9; i++) at = put_number(statev, at, counts[i]);
  for (int i = 0; i < 4; i++) at = put_number(statev, at, jstep[i]);
  at = put_number(statev, at, *kinc);
  /* The name, as a number in which the order of its letters counts. */
  real name = 0;
  for (size_t i = 0; i < cmname_length; i++) name = (name + (real)((i + 1) * (unsigned char)cmname[i]));
  put_number(statev, at, name);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) ddsdde[i + n * j] = i < *ndi ? (j < *ndi ? props[0] : 0) : 0;
  for (int i = 0; i < n; i++) ddsdde[i + n * i] += i < *ndi ? 2 * props[1] : props[1];
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) stress[i] += ddsdde[i + n * j] * dstran[j];
}
