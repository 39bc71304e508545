/* A material law in a shared library, in C, C++ or Fortran (iso_c_binding). Version 1.
 *
 * A library exports, for a law with the name NAME, one function and three variables:
 *
 *   int NAME(const double F_n[9], const double F[9], double dt, const double *state_n, const double *properties,
 *            double *energy, double P[9], double dPdF[81], double *state, char message[BFREE_LAW_MESSAGE]);
 *   const int  NAME_version      = BFREE_LAW_VERSION;
 *   const char NAME_properties[] = "E, nu";                The names of the properties, with commas; "" if there are none.
 *   const char NAME_state[]      = "alpha = 0, Cp11 = 1";  The internal variables and their values at rest; "" if there are none.
 *
 * The macro BFREE_LAW writes them. The function computes one step at one point, three-dimensional; plane strain is F33 = 1.
 *
 *   F_n, F      In.  The deformation gradient at the start and at the end of the step, row by row: F[3*i + j] = dx_i/dX_j.
 *   dt          In.  The length of the step.
 *   state_n     In.  The internal variables at the start of the step.
 *   properties  In.  The properties.
 *   energy      Out, optional. The stored energy per reference volume. It is NaN before the call; leave it if there is none.
 *   P           Out. The first Piola-Kirchhoff stress, row by row: P[3*i + j] is its derivative by F[3*i + j] if there is an energy.
 *   dPdF        Out. The tangent of the step: dPdF[9*(3*i + j) + 3*k + l] = dP_ij/dF_kl, with state_n constant.
 *   state       Out. The internal variables at the end of the step. They equal state_n before the call.
 *   message     Out, optional. A sentence with a final zero if the function does not return 0. It is empty before the call.
 *
 * The function returns 0, or another number if it refuses the step: the caller then tries a shorter one. It keeps nothing between calls; the
 * same input gives the same output. Units are the user's, but consistent: the stress in the units of the properties. No array overlaps
 * another, and none may be NULL, except that state_n, state and properties may point anywhere if they have no entries.
 *
 * Fortran stores matrices by columns: with `real(c_double) :: F(3, 3)`, F(j, i) is dx_i/dX_j.
 */
#ifndef BFREE_LAW_H
#define BFREE_LAW_H

#define BFREE_LAW_VERSION 1
#define BFREE_LAW_MESSAGE 256

#ifdef __cplusplus
#define BFREE_LAW_EXPORT extern "C"
#else
#define BFREE_LAW_EXPORT extern
#endif

/* BFREE_LAW(NAME, "properties", "state") and then the body of the function in braces. */
#define BFREE_LAW(NAME, PROPERTIES, STATE)                                                                     \
  BFREE_LAW_EXPORT const int NAME##_version;                                                                   \
  BFREE_LAW_EXPORT const char NAME##_properties[sizeof(PROPERTIES)];                                           \
  BFREE_LAW_EXPORT const char NAME##_state[sizeof(STATE)];                                                     \
  const int NAME##_version = BFREE_LAW_VERSION;                                                                \
  const char NAME##_properties[sizeof(PROPERTIES)] = PROPERTIES;                                               \
  const char NAME##_state[sizeof(STATE)] = STATE;                                                              \
  BFREE_LAW_EXPORT int NAME(const double F_n[9], const double F[9], double dt, const double *state_n,          \
                            const double *properties, double *energy, double P[9], double dPdF[81],            \
                            double *state, char message[BFREE_LAW_MESSAGE]);                                   \
  int NAME(const double F_n[9], const double F[9], double dt, const double *state_n, const double *properties, \
           double *energy, double P[9], double dPdF[81], double *state, char message[BFREE_LAW_MESSAGE])

#endif
