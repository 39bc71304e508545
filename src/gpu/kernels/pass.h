// A pass over the particles of a block, which sums them into the box of the block. The file is included for each kernel, with
//
//     PASS            its name
//     PASS_ARGUMENTS  its argument, a
//     PASS_OF_A       the `struct Pass` in it
//     PASS_NUMBERS    the numbers of a particle
//     PASS_GATHERS    1 if the particles need u and L
//     PASS_POINT(group, lane, u, l, out)                   adds the numbers of a particle to `out`
//     PASS_SCATTER(w, weights, numbers, at, start, W, out)  sums the particles of a group over a tile of nodes
//
// A thread block is a block of cells. In turns of 16 groups of particles,
// 1. a thread is a particle: it gathers u and L from the box of nodes, and evaluates its numbers;
// 2. a thread is a row along x of the window of a group: it sums the particles of the group over the nodes of the row;
// 3. a thread is a row of the box, and a component: it adds the rows of the groups, in their order.
// Another kernel adds the boxes of the blocks, node by node, in the order of the blocks. So no sum depends on the order of threads.

#define PASS_TILE(W) PASS_SCATTER(w, weights, of_group, at, start, W, row_sums + start * D)

KERNEL(IN_D(PASS), PASS_ARGUMENTS) {
    SHARED(double, shared);
    const struct Pass *pass = &PASS_OF_A;
    const struct Transfer *transfer = &pass->transfer;
    const struct Box box = box_of(transfer, BLOCK);
    double *nodal = shared, *out = nodal + box.nodes * D, *numbers = out + box.nodes * D;
    struct Window *windows = (struct Window *)(numbers + PASS_NUMBERS * THREADS);
    double *sums = (double *)(windows + TURN);
    PHASE(t) {
        for (int i = t; i < box.nodes * D; i += THREADS) nodal[i] = out[i] = 0.0;
    }
    PHASE(t) {
        if (PASS_GATHERS) IN_D(load_box)(transfer, BLOCK, t, pass->u, nodal);
    }
    const u32 groups = transfer->group_first[BLOCK + 1];
    for (u32 turn = transfer->group_first[BLOCK]; turn < groups; turn += TURN) {
        PHASE(t) {
            const u32 group = turn + t / LANES;
            const int lane = t % LANES;
            if (group < groups && lane == 0) windows[t / LANES] = window_of(transfer, &box, group, 0, D);
            if (group < groups && lane < lanes_of(transfer, group)) {
                const struct Window w = window_of(transfer, &box, group, lane, D);
                double u[D], l[D][D], results[PASS_NUMBERS];
                if (PASS_GATHERS) IN_D(gather)(nodal, &w, u, l);
                for (int k = 0; k < PASS_NUMBERS; k++) results[k] = 0.0;
                PASS_POINT(group, lane, u, l, results);
                for (int k = 0; k < PASS_NUMBERS; k++) numbers[(t / LANES * PASS_NUMBERS + k) * LANES + lane] = results[k];
            }
        }
        for (u32 from = 0; from < TURN && turn + from < groups; from += pass->together) {
            // A thread is a row of a group's window.
            PHASE(t) {
                for (u32 i = t; i < (u32)(pass->together * pass->window_rows); i += THREADS) {
                    const u32 k = from + i / pass->window_rows;
                    const int row = i % pass->window_rows;
                    if (k >= TURN || turn + k >= groups) continue;
                    const struct Window *w = &windows[k];
                    if (row >= w->width[1] * w->width[2]) continue;
                    const int at[3] = {0, row % w->width[1], row / w->width[1]};
                    const double *weights = transfer->weights + (i64)transfer->weights_first[turn + k] * LANES;
                    const double *of_group = numbers + k * PASS_NUMBERS * LANES;
                    double *row_sums = sums + ((k - from) * pass->window_nodes + row * w->width[0]) * D;
                    for (int start = 0, width; start < w->width[0]; start += width) {
                        width = tile(w->width[0] - start);
                        WITH_WIDTH(width, PASS_TILE)
                    }
                }
            }
            // A thread is a row of the box, and a component: it adds the groups in their order.
            PHASE(t) {
                for (int i = t; i < box.size[1] * box.size[2] * D; i += THREADS) {
                    const int row = i / D, c = i % D, y = row % box.size[1], z = row / box.size[1];
                    for (u32 k = from; k < from + pass->together && k < TURN && turn + k < groups; k++) {
                        const struct Window *w = &windows[k];
                        const int dy = y - w->place[1], dz = z - w->place[2];
                        if (dy < 0 || dy >= w->width[1] || dz < 0 || dz >= w->width[2]) continue;
                        const int first = (dz * w->width[1] + dy) * w->width[0];
                        const double *own = sums + ((k - from) * pass->window_nodes + first) * D + c;
                        double *row_out = out + (row * box.size[0] + w->place[0]) * D + c;
                        for (int x = 0; x < w->width[0]; x++) row_out[x * D] += own[x * D];
                    }
                }
            }
        }
    }
    double *boxes = pass->boxes + (i64)transfer->box_first[BLOCK] * D;
    PHASE(t) {
        for (int i = t; i < box.nodes * D; i += THREADS) boxes[i] = out[i];
    }
}

#undef PASS
#undef PASS_ARGUMENTS
#undef PASS_OF_A
#undef PASS_NUMBERS
#undef PASS_GATHERS
#undef PASS_POINT
#undef PASS_SCATTER
#undef PASS_TILE
