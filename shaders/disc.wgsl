// The growable disc for maps that a pixel reads: thirteen places, in pairs about the middle. No bindings.
//
// Source:  Oat 2006, 4.5 and listing 2, whose twelve taps lie off the middle by 0.1 R.
// Twin:    src/optics/blur.rs, fn taps
// Parity:  tests/oat.rs, fn the_disc_of_the_pixel_is_that_of_the_twin
// Threads: none of its own.
// Units:   shares of the radius.
// Fails:   finer patterns than a quarter of the radius show as copies.

const DISC = array<vec2f, 6>(
    vec2f(0.423688, 0.179132),
    vec2f(-0.179132, 0.423688),
    vec2f(0.84, 0.0),
    vec2f(0.593970, 0.593970),
    vec2f(0.0, 0.84),
    vec2f(-0.593970, 0.593970),
);
