// What the surfaces after Green (2004) have in common at a pixel: the colour of the tissue. Follows pixel.wgsl.
//
//   color = lerp(inner, outer, opacity)
//
// Source:  Green 2004, 16.4 and 16.4.1 (several colour maps, one a layer of skin).
// Units:   1.

fn color_of(pixel: Pixel) -> vec3f {
    let deep = color_at(inner_map, pixel.uv).rgb;
    return mix(deep, pixel.outer.rgb, pixel.outer.a);
}
