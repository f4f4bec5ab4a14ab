// The id buffer: instance id + 1, and triangle id.

void main()
{
  visibility = vec4(instance_id + 1.0, triangle_id, 0.0, 1.0);
}
