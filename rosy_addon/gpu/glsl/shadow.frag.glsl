// How far away the nearest surface is; 0 where there is none, as before anything is drawn.

void main()
{
  nearest = vec4(away, 0.0, 0.0, 1.0);
}
