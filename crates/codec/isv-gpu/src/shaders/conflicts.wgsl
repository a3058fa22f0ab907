// The faces on which extrapolated blocks of different signs meet: neither side of such a face is observed (isv-decode: extension).

struct ConflictParameters { blocks: u32 }

@group(1) @binding(0) var<uniform> parameters: ConflictParameters;
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read> table: array<u32>;
@group(1) @binding(3) var<storage, read> kinds: array<u32>;
@group(1) @binding(4) var<storage, read> insides: array<u32>;
/// Of each unsettled block, a bit for each face: towards lower and higher x, y and z.
@group(1) @binding(5) var<storage, read_write> opposed: array<u32>;

@compute @workgroup_size(64)
fn conflicts(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let block = (group.y * groups.x + group.x) * 64u + thread;
    if block >= parameters.blocks {
        return;
    }
    var faces = 0u;
    if kinds[block] == UNSETTLED {
        for (var face = 0u; face < 6u; face++) {
            var step = vec3<i32>(0);
            step[face >> 1u] = select(-1, 1, (face & 1u) != 0u);
            let other = find_block(blocks[block].xyz + step);
            if other != NO_BLOCK {
                let is_opposed = (kinds[other] & CODED) == 0u && insides[other] != insides[block];
                faces |= select(0u, 1u << face, is_opposed);
            }
        }
    }
    opposed[block] = faces;
}
