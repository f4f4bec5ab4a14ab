// The depth of the closest surface; 0 where there is none.

in float light_depth;
out vec4 shadow_depth;

void main()
{
  shadow_depth = vec4(light_depth, 0.0, 0.0, 1.0);
}
