// The passes over the particles, for one dimension DIMENSION; see `mechanics/sweep` for the words and the formulas. A pass gathers from the
// nodes, evaluates the particles, and scatters to the nodes. All sums have the order of the loops on the processor (`kernel.rs`), and the same
// bits.

#define D DIMENSION
#define JOIN_(a, b) a##_##b
#define JOIN(a, b) JOIN_(a, b)
#define IN_D(name) JOIN(name, D)

// The numbers of a particle: q, then σ by rows.
#define NUMBERS (D + D * D)
// Pairs of axes (k, l) with k ≤ l. The pair has the index k + l (l + 1) / 2.
#define PAIRS (D * (D + 1) / 2)

// Σ u N and Σ u N' of the row of `width` nodes that begins at `nodal`. `n` and `dn` are the weights of the particle. The width is a constant in
// all calls, so that loops over x are unrolled and arrays lie in registers.
FUNCTION void IN_D(row)(const double *nodal, const double *n, const double *dn, const int width, double *value,
                        double *slope) {
    for (int c = 0; c < D; c++) value[c] = slope[c] = 0.0;
    UNROLL for (int x = 0; x < width; x++)
        for (int c = 0; c < D; c++) {
            value[c] = fma(nodal[x * D + c], n[x], value[c]);
            slope[c] = fma(nodal[x * D + c], dn[x], slope[c]);
        }
}

#if D > 1
// Σ u N_x N_y, Σ u N_x' N_y and Σ u N_x N_y' of the plane that begins at `nodal`.
FUNCTION void IN_D(plane)(const double *nodal, const struct Window *w, const double *n, const double *dn, const int width,
                          double sums[3][D]) {
    const double *ny = w->weights[1], *dy = ny + w->width[1] * LANES;
    for (int c = 0; c < D; c++) sums[0][c] = sums[1][c] = sums[2][c] = 0.0;
    for (int y = 0; y < w->width[1]; y++) {
        double value[D], slope[D];
        IN_D(row)(nodal + y * w->stride[0] * D, n, dn, width, value, slope);
        const double a = ny[y * LANES], b = dy[y * LANES];
        for (int c = 0; c < D; c++) {
            sums[0][c] = fma(value[c], a, sums[0][c]);
            sums[1][c] = fma(slope[c], a, sums[1][c]);
            sums[2][c] = fma(value[c], b, sums[2][c]);
        }
    }
}
#endif

// Adds a tile of nodes along x, from `start` on, to u and L of a particle.
FUNCTION void IN_D(gather_tile)(const double *nodal, const struct Window *w, int start, const int width, double *u,
                                double l[D][D]) {
    double n[WIDEST_TILE], dn[WIDEST_TILE];
    UNROLL for (int x = 0; x < width; x++) {
        n[x] = w->weights[0][(start + x) * LANES];
        dn[x] = w->weights[0][(w->width[0] + start + x) * LANES];
    }
    const double *origin = nodal + (w->first + start) * D;
#if D == 1
    double value[D], slope[D];
    IN_D(row)(origin, n, dn, width, value, slope);
    u[0] = u[0] + value[0];
    l[0][0] = l[0][0] + slope[0];
#elif D == 2
    double sums[3][D];
    IN_D(plane)(origin, w, n, dn, width, sums);
    for (int c = 0; c < D; c++) {
        u[c] = u[c] + sums[0][c];
        l[c][0] = l[c][0] + sums[1][c];
        l[c][1] = l[c][1] + sums[2][c];
    }
#else
    const double *nz = w->weights[2], *dz = nz + w->width[2] * LANES;
    for (int z = 0; z < w->width[2]; z++) {
        double sums[3][D];
        IN_D(plane)(origin + z * w->stride[1] * D, w, n, dn, width, sums);
        const double a = nz[z * LANES], b = dz[z * LANES];
        for (int c = 0; c < D; c++) {
            u[c] = fma(sums[0][c], a, u[c]);
            l[c][0] = fma(sums[1][c], a, l[c][0]);
            l[c][1] = fma(sums[2][c], a, l[c][1]);
            l[c][2] = fma(sums[0][c], b, l[c][2]);
        }
    }
#endif
}

#define GATHER_TILE(W) IN_D(gather_tile)(nodal, w, start, W, u, l)

// u = Σ u_I N_I and L = Σ u_I ⊗ ∇N_I of a particle, from the box of nodes.
FUNCTION void IN_D(gather)(const double *nodal, const struct Window *w, double *u, double l[D][D]) {
    for (int c = 0; c < D; c++) {
        u[c] = 0.0;
        for (int k = 0; k < D; k++) l[c][k] = 0.0;
    }
    for (int start = 0, width; start < w->width[0]; start += width) {
        width = tile(w->width[0] - start);
        WITH_WIDTH(width, GATHER_TILE)
    }
}

// 𝔸 : L of a particle whose numbers begin at `rows`, in one of the three forms (`constitutive/tangents.rs`).
FUNCTION void IN_D(stress)(int form, const double *rows, const double l[D][D], double out[D][D]) {
    if (form == GENERAL) {
        for (int i = 0; i < D; i++)
            for (int k = 0; k < D; k++) out[i][k] = 0.0;
        for (int k = 0; k < D; k++)
            for (int m = 0; m < D; m++)
                for (int i = 0; i < D; i++)
                    for (int j = 0; j < D; j++)
                        out[i][k] = fma(rows[(((k * D + m) * D + i) * D + j) * LANES], l[j][m], out[i][k]);
    } else if (form == CLOSED) {
        IN_D(closed)(rows, l, out);
    } else {
        IN_D(closed_with_factors)(rows, l, out);
    }
}

// (q, σ) of a particle: q = m u, σ = Σ f 𝔸 : L.
FUNCTION void IN_D(evaluate)(const struct Product *a, i64 group, int lane, const double *u, const double l[D][D],
                             double *out) {
    if (a->inertia.mass) {
        double mass = a->inertia.factor * (a->inertia.consistent * a->inertia.mass[group * LANES + lane]);
        for (int c = 0; c < D; c++) out[c] += mass * u[c];
    }
    for (int s = 0; s < a->sets; s++) {
        const struct Rows *set = &a->rows[s];
        double stress[D][D];
        IN_D(stress)(set->form, set->rows + group * set->count * LANES + lane, l, stress);
        for (int i = 0; i < D; i++)
            for (int k = 0; k < D; k++) {
                double one = stress[i][k];
                out[D + i * D + k] += set->factor == 1.0 ? one : set->factor * one;
            }
        if (set->cells) {
            const u32 cell = set->cells[group * LANES + lane];
            const double change = cell == NONE ? 0.0 : set->changes[cell];
            const double *a_of_cell = set->rows + (group * set->count + set->first_of_a) * LANES + lane;
            for (int k = 0; k < D * D; k++) out[D + k] += change * a_of_cell[k * LANES];
        }
    }
}

// A particle at L: H, F_r and the volumes of H, for its law. Where det F ≤ 0, the particle is undeformed, and the pass has failed.
FUNCTION void IN_D(deform)(const struct Solids *a, const double *state, const double l[D][D], double h[D][D],
                           double f_r[D][D], struct Volume *v) {
    double h_r[D][D];
    for (int i = 0; i < D; i++)
        for (int k = 0; k < D; k++) {
            h_r[i][k] = state[(i * D + k) * LANES];
            f_r[i][k] = (i == k ? 1.0 : 0.0) + h_r[i][k];
        }
    IN_D(compose)(l, h_r, h);
    IN_D(change_of_volume)(h, &v->j);
    v->jacobian = 1.0 + v->j;
    if (D > 1 && !(fabs(v->j) < 0.5)) {
        IN_D(determinant)(h, &v->jacobian);
        v->j = v->jacobian - 1.0;
    }
    if (!(v->jacobian > 0.0 && v->jacobian <= DBL_MAX)) {
        *a->failed = 1;
        v->j = 0.0;
        v->jacobian = 1.0;
        for (int i = 0; i < D; i++)
            for (int k = 0; k < D; k++) h[i][k] = 0.0;
    }
    binary_exponent(v);
}

// Calls the formula of a law.
#define OF_LAW(law, name, ...)                                                    \
    switch (law) {                                                                \
    case CIARLET: IN_D(name##_ciarlet)(__VA_ARGS__); break;                       \
    case LOGARITHMIC:                                                             \
        if (v.k == 0) IN_D(name##_logarithmic)(__VA_ARGS__);                      \
        else IN_D(name##_logarithmic_far)(__VA_ARGS__);                           \
        break;                                                                    \
    default: IN_D(name##_st_venant_kirchhoff)(__VA_ARGS__);                       \
    }

// (q, σ) of a particle in the residual: q = α₁ m (φ − φ̂), σ = V₀ F S F_rᵀ; or with the magnitude of σ.
FUNCTION void IN_D(force)(const struct Forces *a, i64 group, int lane, const double *phi, const double l[D][D],
                          double *out) {
    if (a->inertia.mass) {
        const double mass = a->inertia.factor * (a->inertia.consistent * a->inertia.mass[group * LANES + lane]);
        for (int c = 0; c < D; c++) out[c] += mass * (phi[c] - a->predicted[(group * D + c) * LANES + lane]);
    }
    const double *state = a->solids.states + group * (D * D + 1) * LANES + lane, volume = state[D * D * LANES];
    const u32 body = a->solids.bodies[group * LANES + lane];
    const double *constants = a->solids.constants + 2 * body;
    double h[D][D], f_r[D][D], stress[D][D];
    struct Volume v;
    IN_D(deform)(&a->solids, state, l, h, f_r, &v);
    OF_LAW(a->solids.laws[body], stress, h, &v, f_r, volume, constants, stress)
    for (int k = 0; k < D * D; k++) {
        out[D + k] += stress[k / D][k % D];
        if (a->pass.magnitudes) out[D + k] = fabs(out[D + k]);
    }
}

// The tangent of a particle in the closed form, as rows of the lane. Rows behind those of its law are zero.
FUNCTION void IN_D(linearized)(const struct Linearize *a, i64 group, int lane, const double *u, const double l[D][D]) {
    const double *state = a->solids.states + group * (D * D + 1) * LANES + lane, volume = state[D * D * LANES];
    const u32 body = a->solids.bodies[group * LANES + lane];
    const double *constants = a->solids.constants + 2 * body;
    double h[D][D], f_r[D][D], *rows = a->rows + group * a->count * LANES + lane;
    struct Volume v;
    IN_D(deform)(&a->solids, state, l, h, f_r, &v);
    for (int k = D * D + PAIRS + 2; k < a->count; k++) rows[k * LANES] = 0.0;
    OF_LAW(a->solids.laws[body], tangent, h, &v, f_r, volume, constants, rows)
}

// A given force of a particle.
FUNCTION void IN_D(force_of)(const struct Spread *a, i64 group, int lane, double *out) {
    const i64 particle = (i64)a->pass.transfer.particle_first[group] + lane;
    for (int c = 0; c < D; c++)
        if (c < a->components) out[c] = a->forces[particle * a->components + c];
}

// Row i of 𝔸_kl + 𝔸_lk for all pairs k < l, and of 𝔸_kk.
FUNCTION void IN_D(pairs)(int form, const double *rows, int i, double out[PAIRS][D]) {
    if (form == GENERAL) {
        for (int l = 0; l < D; l++)
            for (int k = 0; k <= l; k++)
                for (int j = 0; j < D; j++) {
                    const double one = rows[(((k * D + l) * D + i) * D + j) * LANES];
                    out[k + l * (l + 1) / 2][j] = k == l ? one : one + rows[(((l * D + k) * D + i) * D + j) * LANES];
                }
        return;
    }
#define PAIRS_OF_ROW(I)                                  \
    case I:                                              \
        if (form == CLOSED) IN_D(pairs_##I)(rows, out);  \
        else IN_D(pairs_with_factors_##I)(rows, out);    \
        break;
    switch (i) {
#if D > 1
        PAIRS_OF_ROW(1)
#endif
#if D > 2
        PAIRS_OF_ROW(2)
#endif
    default:
        PAIRS_OF_ROW(0)
    }
#undef PAIRS_OF_ROW
}

// The numbers of a particle for row i of the diagonal blocks: those of all pairs, then the mass.
FUNCTION void IN_D(block_row)(const struct DiagonalBlocks *a, i64 group, int lane, double *out) {
    const struct Product *product = &a->product;
    for (int s = 0; s < product->sets; s++) {
        const struct Rows *set = &product->rows[s];
        double of_pairs[PAIRS][D];
        IN_D(pairs)(set->form, set->rows + group * set->count * LANES + lane, a->i, of_pairs);
        for (int k = 0; k < PAIRS * D; k++) out[k] = fma(set->factor, of_pairs[k / D][k % D], out[k]);
    }
    if (product->inertia.mass)
        out[PAIRS * D] +=
            product->inertia.factor * (product->inertia.consistent * product->inertia.mass[group * LANES + lane]);
}

// N of the nodes of a tile along x, and N', of one particle; or their magnitudes.
FUNCTION void IN_D(along)(const struct Window *w, const double *weights, int start, const int width, const int magnitudes,
                          double *n, double *dn) {
    UNROLL for (int x = 0; x < width; x++) {
        const double value = weights[(start + x) * LANES], slope = weights[(w->width[0] + start + x) * LANES];
        n[x] = magnitudes ? fabs(value) : value;
        dn[x] = magnitudes ? fabs(slope) : slope;
    }
}

// The products of the weights of one particle across x, in the row (y, z) of its window: N_y N_z, N_y' N_z, N_y N_z'; or their magnitudes.
FUNCTION void IN_D(across)(const struct Window *w, const double *weights, const int *at, const int magnitudes,
                           double *products) {
    for (int k = 0; k < D; k++) products[k] = 1.0;
    const double *rows = weights + 2 * w->width[0] * LANES;
    for (int axis = 1; axis < D; axis++) {
        const double value = rows[at[axis] * LANES], slope = rows[(w->width[axis] + at[axis]) * LANES];
        for (int k = 0; k < D; k++) products[k] = products[k] * (k == axis ? slope : value);
        rows += 2 * w->width[axis] * LANES;
    }
    for (int k = 0; k < D && magnitudes; k++) products[k] = fabs(products[k]);
}

// Σ q N_I + σ ∇N_I over the particles of a group, for a tile of nodes along the row (y, z) of its window, all components.
FUNCTION void IN_D(scatter)(const struct Pass *a, const int magnitudes, const struct Window *w, const double *weights,
                            const double *numbers, const int *at, int start, const int width, double *out) {
    double sums[D][WIDEST_TILE];
    for (int c = 0; c < D; c++)
        UNROLL for (int x = 0; x < width; x++) sums[c][x] = 0.0;
    for (int p = 0; p < w->lanes; p++) {
        double products[D], n[WIDEST_TILE], dn[WIDEST_TILE];
        IN_D(across)(w, weights + p, at, magnitudes, products);
        IN_D(along)(w, weights + p, start, width, magnitudes, n, dn);
        const double *q = numbers + p, *stress = numbers + D * LANES + p;
        for (int c = 0; c < D; c++) {
            double across = 0.0, along = 0.0;
            if (a->gradients) {
                for (int k = 1; k < D; k++) across = fma(stress[(c * D + k) * LANES], products[k], across);
                along = stress[c * D * LANES] * products[0];
            }
            if (a->values) across = fma(q[c * LANES], products[0], across);
            UNROLL for (int x = 0; x < width; x++) {
                sums[c][x] = fma(across, n[x], sums[c][x]);
                if (a->gradients) sums[c][x] = fma(along, dn[x], sums[c][x]);
            }
        }
    }
    UNROLL for (int x = 0; x < width; x++)
        for (int c = 0; c < D; c++) out[x * D + c] = sums[c][x];
}

// Row i of the diagonal blocks of a quadratic form, Σ B(∇N_I, ∇N_I) + m N_I² I over the particles of a group, for a tile of nodes along the row (y, z) of
// its window (`sweep/blocks.rs`).
FUNCTION void IN_D(scatter_blocks)(int i, const struct Window *w, const double *weights, const double *numbers,
                                   const int *at, int start, const int width, double *out) {
    double sums[D][WIDEST_TILE];
    for (int j = 0; j < D; j++)
        UNROLL for (int x = 0; x < width; x++) sums[j][x] = 0.0;
    for (int p = 0; p < w->lanes; p++) {
        double products[D], n[WIDEST_TILE], dn[WIDEST_TILE];
        IN_D(across)(w, weights + p, at, 0, products);
        IN_D(along)(w, weights + p, start, width, 0, n, dn);
        const double *of_pairs = numbers + p;
        // The coefficients of N_x'², N_x N_x' and N_x².
        double powers[3][D];
        for (int k = 0; k < 3 * D; k++) powers[k / D][k % D] = 0.0;
        for (int l = 0; l < D; l++)
            for (int k = 0; k <= l; k++) {
                const double product = products[k] * products[l];
                double *power = powers[(k > 0) + (l > 0)];
                for (int j = 0; j < D; j++)
                    power[j] = fma(of_pairs[((k + l * (l + 1) / 2) * D + j) * LANES], product, power[j]);
            }
        const double mass = of_pairs[PAIRS * D * LANES], square = products[0] * products[0];
        for (int j = 0; j < D; j++)
            if (j == i) powers[2][j] = fma(mass, square, powers[2][j]);
        UNROLL for (int x = 0; x < width; x++) {
            const double two = dn[x] * dn[x], one = n[x] * dn[x], none = n[x] * n[x];
            for (int j = 0; j < D; j++) {
                sums[j][x] = fma(powers[0][j], two, sums[j][x]);
                if (D > 1) sums[j][x] = fma(powers[1][j], one, sums[j][x]);
                sums[j][x] = fma(powers[2][j], none, sums[j][x]);
            }
        }
    }
    UNROLL for (int x = 0; x < width; x++)
        for (int j = 0; j < D; j++) out[x * D + j] = sums[j][x];
}

// Copies the field to the active nodes of the box, by thread t.
FUNCTION void IN_D(load_box)(const struct Transfer *a, u32 block, int t, const double *u, double *nodal) {
    for (u32 i = a->node_first[block] + t; i < a->node_first[block + 1]; i += THREADS)
        for (int c = 0; c < D; c++) nodal[a->places[i] * D + c] = u[(i64)a->nodes[i] * D + c];
}

// A kernel that calls POINT(a, group, lane, u, L) for all particles.
#define GATHER_KERNEL(name, Arguments, POINT)                                                                          \
    KERNEL(IN_D(name), Arguments) {                                                                                    \
        SHARED(double, nodal);                                                                                         \
        const struct Transfer *transfer = &a.transfer;                                                                 \
        const struct Box box = box_of(transfer, BLOCK);                                                                \
        PHASE(t) {                                                                                                     \
            for (int i = t; i < box.nodes * D; i += THREADS) nodal[i] = 0.0;                                           \
        }                                                                                                              \
        PHASE(t) { IN_D(load_box)(transfer, BLOCK, t, a.u, nodal); }                                                   \
        const u32 first = transfer->group_first[BLOCK] * LANES, end = transfer->group_first[BLOCK + 1] * LANES;        \
        PHASE(t) {                                                                                                     \
            for (u32 slot = first + t; slot < end; slot += THREADS) {                                                  \
                const u32 group = slot / LANES;                                                                        \
                const int lane = slot % LANES;                                                                         \
                if (lane >= lanes_of(transfer, group)) continue;                                                       \
                const struct Window w = window_of(transfer, &box, group, lane, D);                                     \
                double u[D], l[D][D];                                                                                  \
                IN_D(gather)(nodal, &w, u, l);                                                                         \
                POINT(&a, group, lane, u, l);                                                                          \
            }                                                                                                          \
        }                                                                                                              \
    }

// The change of volume of a particle of an averaged cell: b : L.
FUNCTION void IN_D(volume)(const struct Volumes *a, i64 group, int lane, const double *u, const double l[D][D]) {
    const double *b = a->rows + (group * a->count + a->first_of_b) * LANES + lane;
    double sum = 0.0;
    for (int k = 0; k < D * D; k++) sum += b[k * LANES] * l[k / D][k % D];
    a->volumes[group * LANES + lane] = sum;
}

// u of a particle, and L.
FUNCTION void IN_D(at_particle)(const struct AtParticles *a, i64 group, int lane, const double *u, const double l[D][D]) {
    double *results = a->results + ((i64)a->transfer.particle_first[group] + lane) * a->stride + a->first;
    for (int c = 0; c < D; c++) results[c] = u[c];
    if (a->gradient)
        for (int k = 0; k < D * D; k++) results[D + k] = l[k % D][k / D];
}

GATHER_KERNEL(volumes, Volumes, IN_D(volume))
GATHER_KERNEL(at_particles, AtParticles, IN_D(at_particle))
// The tangents of all particles. Rows of empty lanes keep the zeros that they have before.
GATHER_KERNEL(linearize, Linearize, IN_D(linearized))

// K u, without lumped masses.
#define PASS product
#define PASS_ARGUMENTS Product
#define PASS_OF_A a.pass
#define PASS_NUMBERS NUMBERS
#define PASS_GATHERS 1
#define PASS_POINT(group, lane, u, l, out) IN_D(evaluate)(&a, group, lane, u, l, out)
#define PASS_SCATTER(...) IN_D(scatter)(&a.pass, 0, __VA_ARGS__)
#include "pass.h"

// Row i of the diagonal blocks of K, without lumped masses.
#define PASS diagonal_blocks
#define PASS_ARGUMENTS DiagonalBlocks
#define PASS_OF_A a.product.pass
#define PASS_NUMBERS (PAIRS * D + 1)
#define PASS_GATHERS 0
#define PASS_POINT(group, lane, u, l, out) IN_D(block_row)(&a, group, lane, out)
#define PASS_SCATTER(...) IN_D(scatter_blocks)(a.i, __VA_ARGS__)
#include "pass.h"

// The residual's part at the particles, or its magnitude.
#define PASS forces
#define PASS_ARGUMENTS Forces
#define PASS_OF_A a.pass
#define PASS_NUMBERS NUMBERS
#define PASS_GATHERS 1
#define PASS_POINT(group, lane, u, l, out) IN_D(force)(&a, group, lane, u, l, out)
#define PASS_SCATTER(...) IN_D(scatter)(&a.pass, a.pass.magnitudes, __VA_ARGS__)
#include "pass.h"

// Σ q N_I of forces q.
#define PASS spread
#define PASS_ARGUMENTS Spread
#define PASS_OF_A a.pass
#define PASS_NUMBERS D
#define PASS_GATHERS 0
#define PASS_POINT(group, lane, u, l, out) IN_D(force_of)(&a, group, lane, out)
#define PASS_SCATTER(...) IN_D(scatter)(&a.pass, 0, __VA_ARGS__)
#include "pass.h"

#undef NUMBERS
#undef PAIRS
#undef GATHER_TILE
#undef GATHER_KERNEL
#undef OF_LAW
#undef IN_D
#undef JOIN
#undef JOIN_
#undef D
#undef DIMENSION
