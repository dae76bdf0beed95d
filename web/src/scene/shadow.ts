// The shadow of the scope's lamp, instead of three's text for all kinds of lamps: some looks at the shadow map around a
// place, on a spiral that is turned from pixel to pixel, make an edge as soft as that of a lamp of some size.
export const SHADOW = `
#if NUM_SPOT_LIGHT_COORDS > 0
varying vec4 vSpotLightCoord[NUM_SPOT_LIGHT_COORDS];
#endif
#if defined(USE_SHADOWMAP) && NUM_SPOT_LIGHT_SHADOWS > 0
struct SpotLightShadow { float shadowIntensity; float shadowBias; float shadowNormalBias; float shadowRadius; vec2 shadowMapSize; };
uniform sampler2D spotShadowMap[NUM_SPOT_LIGHT_SHADOWS];
uniform SpotLightShadow spotLightShadows[NUM_SPOT_LIGHT_SHADOWS];
float getShadow(sampler2D map, vec2 size, float intensity, float bias, float radius, vec4 at) {
  vec3 place = at.xyz / at.w;
  float turn = 6.2832 * fract(52.98 * fract(dot(gl_FragCoord.xy, vec2(0.0671, 0.00584)))), lit = 0.0;
  for (int i = 0; i < 6; i++) {
    vec2 off = sqrt((float(i) + 0.5) / 6.0) * 4.5 * radius / size * vec2(cos(turn), sin(turn));
    lit += step(place.z + bias, unpackRGBAToDepth(texture2D(map, place.xy + off)));
    turn += 2.4;
  }
  return mix(1.0, lit / 6.0, intensity);
}
#endif`;
