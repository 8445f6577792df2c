// Copies the positions of all points into slots, where neighbours lie side by side.
//
// Source:  Morton, "A Computer Oriented Geodetic Data Base" (1966), the use of an order that keeps
//          neighbours together; the order itself is made in src/geom/patch.rs.
// Twin:    src/geom/patch.rs, fn spatial_order
// Parity:  tests/gpu_parity.rs, fn full_planes_match_the_cpu_twin
// Threads: one per slot.
// Units:   metres.
// Fails:   nowhere.

struct Params {
    slot_count: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read_write> slots: array<vec4f>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x < params.slot_count {
        slots[id.x] = positions[order[id.x]];
    }
}
