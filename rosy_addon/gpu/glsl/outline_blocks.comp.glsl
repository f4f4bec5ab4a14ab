// The edges in each pixel of the finished picture: EDGE_BIT with the bits of borders, or 0 if there is none.

uniform sampler2D outline_edges;
uniform int supersampling;
uniform ivec2 box_origin;
layout(r32f) uniform writeonly image2D outline_blocks;

void main()
{
  ivec2 block = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  if (any(greaterThanEqual(block, imageSize(outline_blocks)))) {
    return;
  }
  int bits = 0;
  for (int y = 0; y < supersampling; ++y) {
    for (int x = 0; x < supersampling; ++x) {
      vec4 edge = texelFetch(outline_edges, block * supersampling + ivec2(x, y), 0);
      bits |= edge.x > 0.0 ? EDGE_BIT | int(edge.y) : 0;
    }
  }
  imageStore(outline_blocks, block, vec4(float(bits), 0.0, 0.0, 0.0));
}
