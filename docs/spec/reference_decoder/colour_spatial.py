"""Section 7.14.7: spatial blocks."""

from colour_cells import interleaved, position
from colour_transform import GREY, add_differences, limited, mean, mean_change, minus, plus
from conventions import NEIGHBOURS, add


def decode_spatial(blocks, levels, steps, constrained):
    """Writes the samples of all spatial blocks. `blocks`: those of the frame, of which the temporal ones have their samples.
    `constrained`: whether these are as if they were not there (kind 2)."""
    spatial = [b for b, block in blocks.items() if block.vector is None]
    if not spatial:
        return
    if constrained:
        blocks = {b: blocks[b] for b in spatial}
    trees = {b: blocks[b].tree() for b in blocks}
    means = {b: means_of_temporal(block, trees[b]) if block.vector is not None else [{} for _ in range(6)]
             for b, block in blocks.items()}
    for b in spatial:
        means[b][0] = {0: root(b, blocks, means, trees[b][0][0], levels[b], steps)}
    for level in range(5):
        below = {}
        for b in spatial:
            if blocks[b].depth >= level - 2:
                below[b] = children_means(b, level, blocks, means, trees[b], levels[b][max(level - 2, 0)], steps)
        for b, found in below.items():
            means[b][level + 1] = found
    for b in spatial:
        blocks[b].samples = means[b][3:]


def means_of_temporal(block, tree):
    """The means of all nodes, by level."""
    means = [{}, {}, {}, *block.samples]
    for level in (2, 1, 0):
        for place in tree[level]:
            children = [place << 3 | c for c in range(8) if place << 3 | c in tree[level + 1]]
            of_children = [means[level + 1][child] for child in children]
            means[level][place] = limited(mean(of_children, [tree[level + 1][child] for child in children]))
    return means


def root(b, blocks, means, weight, levels, steps):
    colours, weights = [], []
    for d in NEIGHBOURS:
        # Blocks before b have a mean by now.
        around = means.get(add(b, d), [{}])[0]
        if around:
            colours.append(around[0])
            weights.append(4 - sum(c != 0 for c in d))
    predicted = mean(colours, weights) if colours else GREY
    change = levels[0].get((-1, 0), {}).get(0, (0, 0, 0))
    return limited(plus(predicted, mean_change(change, steps, weight)))


def node_mean(at, level, blocks, means):
    """The mean of the node at coordinates on the grid of a level over all of space; None if there is none."""
    b = tuple(c >> level for c in at)
    if b not in blocks:
        return None
    place = interleaved(*(c & (1 << level) - 1 for c in at))
    block = blocks[b]
    if place not in block.there[level]:
        return None
    if level == 4 and block.depth == 0:
        return means[b][3][place >> 3]
    return means[b][level][place]


def children_means(b, level, blocks, means, tree, levels, steps):
    """children_of all nodes of a level of a block"""
    found = {}
    for place in tree[level]:
        children = [c for c in range(8) if place << 3 | c in tree[level + 1]]
        weights = {c: tree[level + 1][place << 3 | c] for c in children}
        at = add(tuple(c << level for c in b), position(place))
        values = {c: predicted_child(at, level, c, blocks, means) for c in children}
        by = minus(means[b][level][place], mean(list(values.values()), list(weights.values())))
        for c in children:
            values[c] = plus(values[c], by)
        add_differences(values, weights, levels.get((level, place), {}), steps)
        for c in children:
            found[place << 3 | c] = limited(values[c])
    return found


def predicted_child(at, level, child, blocks, means):
    steps = [1 if child >> axis & 1 else -1 for axis in range(3)]
    colours, weights = [], []
    for corner in range(8):
        moved = [corner >> axis & 1 for axis in range(3)]
        near = node_mean(add(at, tuple(s * m for s, m in zip(steps, moved))), level, blocks, means)
        if near is not None:
            colours.append(near)
            weights.append(3 ** (3 - sum(moved)))
    return mean(colours, weights)
