// The id of the triangle in the picture, as the bits of a float; 0 where there is none.

uniform int first_triangle_id;
in float triangle_id;
out vec4 visibility;

void main()
{
  visibility = vec4(uintBitsToFloat(uint(first_triangle_id) + uint(triangle_id)), 0.0, 0.0, 1.0);
}
