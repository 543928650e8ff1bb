! As fields.cc, with the module MODULE in its place.
program fields
  use, intrinsic :: iso_fortran_env, only: input_unit
  use MODULE
  implicit none
  integer, parameter :: d = dimension_of_space
  type(solution) :: s
  type(parameters) :: par
  character(:), allocatable :: message
  real(dp) :: count, point(d + 1), X(d), t
  integer :: k, input, output
  call prepare(s, par, message)
  if (len(message) > 0) error stop 1
  open (newunit=input, file="points.bin", access="stream", form="unformatted", action="read")
  open (newunit=output, file="values.bin", access="stream", form="unformatted", action="write", status="replace")
  read (input) count
  do k = 1, nint(count)
    read (input) point
    X = point(1:d)
    t = point(d + 1)
    write (output) u(s, X, t), v(s, X, t), a(s, X, t), transpose(H(s, X, t)), transpose(F(s, X, t)), J(s, X, t), &
      transpose(P(s, X, t)), b(s, X, t), rho0_b(s, X, t), static_force(s, X, t), transpose(sigma(s, X, t)), &
      transpose(pk2(s, X, t))
  end do
end program
