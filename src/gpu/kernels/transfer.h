// The product of the tangent with a nodal field, for one dimension DIMENSION; see `mechanics/sweep` for the words and the formulas.
//
// A thread block is a block of cells. In turns of 16 groups of particles,
// 1. a thread is a particle: it gathers u and L from the box of nodes, and evaluates (q, σ);
// 2. a thread is a row along x of the window of a group: it sums the particles of the group over the nodes of the row;
// 3. a thread is a row of the box, and a component: it adds the rows of the groups, in their order.
// A second kernel adds the boxes of the blocks, node by node, in the order of the blocks. So no sum depends on the order of threads, and all
// sums have the order of the loops on the processor (`kernel.rs`), and the same bits.

#define D DIMENSION
#define JOIN_(a, b) a##_##b
#define JOIN(a, b) JOIN_(a, b)
#define IN_D(name) JOIN(name, D)

// The numbers of a particle: q, then σ by rows.
#define NUMBERS (D + D * D)

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
    for (int k = 0; k < NUMBERS; k++) out[k] = 0.0;
    if (a->mass) {
        double mass = a->mass_factor * (a->consistent * a->mass[group * LANES + lane]);
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

// Σ q N_I + σ ∇N_I over the particles of a group, for a tile of nodes along the row (y, z) of its window, all components.
FUNCTION void IN_D(scatter_tile)(const struct Product *a, const struct Window *w, const double *weights,
                                 const double *numbers, const int *at, int start, const int width, double *out) {
    double sums[D][WIDEST_TILE];
    const int has_sets = a->sets > 0, has_mass = a->mass != 0;
    for (int c = 0; c < D; c++)
        UNROLL for (int x = 0; x < width; x++) sums[c][x] = 0.0;
    for (int p = 0; p < w->lanes; p++) {
        double products[D], n[WIDEST_TILE], dn[WIDEST_TILE];
        for (int k = 0; k < D; k++) products[k] = 1.0;
        const double *rows = weights + 2 * w->width[0] * LANES + p;
        for (int axis = 1; axis < D; axis++) {
            const double value = rows[at[axis] * LANES], slope = rows[(w->width[axis] + at[axis]) * LANES];
            for (int k = 0; k < D; k++) products[k] = products[k] * (k == axis ? slope : value);
            rows += 2 * w->width[axis] * LANES;
        }
        UNROLL for (int x = 0; x < width; x++) {
            n[x] = weights[(start + x) * LANES + p];
            dn[x] = weights[(w->width[0] + start + x) * LANES + p];
        }
        const double *q = numbers + p, *stress = numbers + D * LANES + p;
        for (int c = 0; c < D; c++) {
            double across = 0.0, along = 0.0;
            if (has_sets) {
                for (int k = 1; k < D; k++) across = fma(stress[(c * D + k) * LANES], products[k], across);
                along = stress[c * D * LANES] * products[0];
            }
            if (has_mass) across = fma(q[c * LANES], products[0], across);
            UNROLL for (int x = 0; x < width; x++) {
                sums[c][x] = fma(across, n[x], sums[c][x]);
                if (has_sets) sums[c][x] = fma(along, dn[x], sums[c][x]);
            }
        }
    }
    UNROLL for (int x = 0; x < width; x++)
        for (int c = 0; c < D; c++) out[x * D + c] = sums[c][x];
}

#define SCATTER_TILE(W) IN_D(scatter_tile)(a, w, weights, numbers, at, start, W, out + start * D)

// All tiles of the row.
FUNCTION void IN_D(scatter)(const struct Product *a, const struct Window *w, const double *weights, const double *numbers,
                            const int *at, double *out) {
    for (int start = 0, width; start < w->width[0]; start += width) {
        width = tile(w->width[0] - start);
        WITH_WIDTH(width, SCATTER_TILE)
    }
}

// Copies the field to the active nodes of the box, by thread t.
FUNCTION void IN_D(load_box)(const struct Transfer *a, u32 block, int t, const double *u, double *nodal) {
    for (u32 i = a->node_first[block] + t; i < a->node_first[block + 1]; i += THREADS)
        for (int c = 0; c < D; c++) nodal[a->places[i] * D + c] = u[(i64)a->nodes[i] * D + c];
}

// The changes of volume of the particles of averaged cells: b : L.
KERNEL(IN_D(volumes), Volumes) {
    SHARED(double, nodal);
    const struct Box box = box_of(&a.transfer, BLOCK);
    PHASE(t) {
        for (int i = t; i < box.nodes * D; i += THREADS) nodal[i] = 0.0;
    }
    PHASE(t) { IN_D(load_box)(&a.transfer, BLOCK, t, a.u, nodal); }
    const u32 first = a.transfer.group_first[BLOCK] * LANES, end = a.transfer.group_first[BLOCK + 1] * LANES;
    PHASE(t) {
        for (u32 slot = first + t; slot < end; slot += THREADS) {
            const u32 group = slot / LANES;
            const int lane = slot % LANES;
            double sum = 0.0;
            if (lane < lanes_of(&a.transfer, group)) {
                const struct Window w = window_of(&a.transfer, &box, group, lane, D);
                const double *b = a.rows + ((i64)group * a.count + a.first_of_b) * LANES + lane;
                double u[D], l[D][D];
                IN_D(gather)(nodal, &w, u, l);
                for (int k = 0; k < D * D; k++) sum += b[k * LANES] * l[k / D][k % D];
            }
            a.volumes[slot] = sum;
        }
    }
}

// The box of a block: its part of K u, without lumped masses.
KERNEL(IN_D(product), Product) {
    SHARED(double, shared);
    const struct Box box = box_of(&a.transfer, BLOCK);
    double *nodal = shared, *out = nodal + box.nodes * D, *numbers = out + box.nodes * D;
    struct Window *windows = (struct Window *)(numbers + NUMBERS * THREADS);
    double *sums = (double *)(windows + TURN);
    PHASE(t) {
        for (int i = t; i < box.nodes * D; i += THREADS) nodal[i] = out[i] = 0.0;
    }
    PHASE(t) { IN_D(load_box)(&a.transfer, BLOCK, t, a.u, nodal); }
    const u32 groups = a.transfer.group_first[BLOCK + 1];
    for (u32 turn = a.transfer.group_first[BLOCK]; turn < groups; turn += TURN) {
        PHASE(t) {
            const u32 group = turn + t / LANES;
            const int lane = t % LANES;
            if (group < groups && lane == 0) windows[t / LANES] = window_of(&a.transfer, &box, group, 0, D);
            if (group < groups && lane < lanes_of(&a.transfer, group)) {
                const struct Window w = window_of(&a.transfer, &box, group, lane, D);
                double u[D], l[D][D], results[NUMBERS];
                IN_D(gather)(nodal, &w, u, l);
                IN_D(evaluate)(&a, group, lane, u, l, results);
                for (int k = 0; k < NUMBERS; k++) numbers[(t / LANES * NUMBERS + k) * LANES + lane] = results[k];
            }
        }
        for (u32 from = 0; from < TURN && turn + from < groups; from += a.together) {
            // A thread is a row of a group's window.
            PHASE(t) {
                for (u32 i = t; i < (u32)(a.together * a.window_rows); i += THREADS) {
                    const u32 k = from + i / a.window_rows;
                    const int row = i % a.window_rows;
                    if (k >= TURN || turn + k >= groups) continue;
                    const struct Window *w = &windows[k];
                    if (row >= w->width[1] * w->width[2]) continue;
                    const int at[3] = {0, row % w->width[1], row / w->width[1]};
                    const double *weights = a.transfer.weights + (i64)a.transfer.weights_first[turn + k] * LANES;
                    double *own = sums + ((k - from) * a.window_nodes + row * w->width[0]) * D;
                    IN_D(scatter)(&a, w, weights, numbers + k * NUMBERS * LANES, at, own);
                }
            }
            // A thread is a row of the box, and a component: it adds the groups in their order.
            PHASE(t) {
                for (int i = t; i < box.size[1] * box.size[2] * D; i += THREADS) {
                    const int row = i / D, c = i % D, y = row % box.size[1], z = row / box.size[1];
                    for (u32 k = from; k < from + a.together && k < TURN && turn + k < groups; k++) {
                        const struct Window *w = &windows[k];
                        const int dy = y - w->place[1], dz = z - w->place[2];
                        if (dy < 0 || dy >= w->width[1] || dz < 0 || dz >= w->width[2]) continue;
                        const int first = (dz * w->width[1] + dy) * w->width[0];
                        const double *own = sums + ((k - from) * a.window_nodes + first) * D + c;
                        double *row_out = out + (row * box.size[0] + w->place[0]) * D + c;
                        for (int x = 0; x < w->width[0]; x++) row_out[x * D] += own[x * D];
                    }
                }
            }
        }
    }
    double *boxes = a.boxes + (i64)a.transfer.box_first[BLOCK] * D;
    PHASE(t) {
        for (int i = t; i < box.nodes * D; i += THREADS) boxes[i] = out[i];
    }
}

#undef NUMBERS
#undef GATHER_TILE
#undef SCATTER_TILE
#undef IN_D
#undef JOIN
#undef JOIN_
#undef D
#undef DIMENSION
