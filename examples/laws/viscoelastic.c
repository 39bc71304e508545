/* Saint Venant-Kirchhoff solid with a Maxwell branch: S = L : E + Q, dQ/dt + Q/tau = g L : dE/dt.
 * Over a step the rate of E is constant: Q = a Q_n + g b L : (E - E_n), a = exp(-dt/tau), b = tau/dt (1 - a). */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "bfree_law.h"

/* The places of a symmetric tensor's six numbers, 11, 22, 33, 12, 13, 23, in nine. */
static const int symmetric[9] = {0, 3, 4, 3, 1, 5, 4, 5, 2};

static double determinant(const double F[9]) {
  return F[0] * (F[4] * F[8] - F[5] * F[7]) - F[1] * (F[3] * F[8] - F[5] * F[6]) + F[2] * (F[3] * F[7] - F[4] * F[6]);
}

/* E = (F^T F - 1)/2. */
static void green_lagrange(const double F[9], double E[9]) {
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) {
      double sum = i == j ? -1 : 0;
      for (int k = 0; k < 3; k++) sum += F[3 * k + i] * F[3 * k + j];
      E[3 * i + j] = sum / 2;
    }
}

/* L : E = lambda tr E + 2 mu E. */
static double hooke(double lambda, double mu, const double E[9], int place) {
  return 2 * mu * E[place] + (place % 4 == 0 ? lambda * (E[0] + E[4] + E[8]) : 0);
}

/* The derivative of P = F S by F for dS/dE = L: delta_ik S_lj + lambda F_ij F_kl + mu (F_il F_kj + delta_lj (F F^T)_ik). */
static void tangent(const double F[9], const double S[9], double lambda, double mu, double dPdF[81]) {
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      for (int k = 0; k < 3; k++)
        for (int l = 0; l < 3; l++) {
          const double b = F[3 * i] * F[3 * k] + F[3 * i + 1] * F[3 * k + 1] + F[3 * i + 2] * F[3 * k + 2];
          const double geometric = i == k ? S[3 * l + j] : 0;
          dPdF[9 * (3 * i + j) + 3 * k + l] = geometric + lambda * F[3 * i + j] * F[3 * k + l] +
                                              mu * (F[3 * i + l] * F[3 * k + j] + (l == j ? b : 0));
        }
}

BFREE_LAW(viscoelastic, "lambda, mu, g, tau", "Q11 = 0, Q22 = 0, Q33 = 0, Q12 = 0, Q13 = 0, Q23 = 0") {
  const double lambda = properties[0], mu = properties[1], g = properties[2], tau = properties[3];
  double E_n[9], E[9], rate[9], S[9];
  if (determinant(F) <= 0) {
    snprintf(message, BFREE_LAW_MESSAGE, "det F = %g, but it must be positive.", determinant(F));
    return 1;
  }
  const double a = exp(-dt / tau), b = dt > 0 ? -expm1(-dt / tau) * tau / dt : 1;
  green_lagrange(F_n, E_n);
  green_lagrange(F, E);
  for (int i = 0; i < 9; i++) rate[i] = E[i] - E_n[i];
  double elastic = 0, squares = 0, trace = 0;
  for (int i = 0; i < 9; i++) {
    const double Q = a * state_n[symmetric[i]] + g * b * hooke(lambda, mu, rate, i);
    state[symmetric[i]] = Q;
    S[i] = hooke(lambda, mu, E, i) + Q;
    elastic += E[i] * hooke(lambda, mu, E, i) / 2;
    squares += Q * Q;
    trace += i % 4 == 0 ? Q : 0;
  }
  /* The energy of both springs; that of the branch is Q : L^-1 : Q / (2 g). */
  *energy = elastic;
  if (g > 0) *energy += (squares - lambda / (3 * lambda + 2 * mu) * trace * trace) / (4 * mu * g);
  memset(P, 0, 9 * sizeof(double));
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      for (int k = 0; k < 3; k++) P[3 * i + j] += F[3 * i + k] * S[3 * k + j];
  tangent(F, S, (1 + g * b) * lambda, (1 + g * b) * mu, dPdF);
  return 0;
}
