! Saint Venant-Kirchhoff solid through bfree_law.h, in Fortran: S = lambda tr E + 2 mu E, P = F S.
! Matrices are stored by columns here, by rows there: each 3x3 matrix arrives transposed.
module saint_venant_law
  use, intrinsic :: iso_c_binding
  implicit none
  integer(c_int), bind(c, name='saint_venant_version') :: version = 1
  character(kind=c_char), bind(c, name='saint_venant_properties') :: names(11) = &
    ['l', 'a', 'm', 'b', 'd', 'a', ',', ' ', 'm', 'u', c_null_char]
  character(kind=c_char), bind(c, name='saint_venant_state') :: state_names(1) = [c_null_char]

contains

  integer(c_int) function saint_venant(f_n, ft, dt, state_n, properties, energy, pt, tangent, state, message) bind(c)
    real(c_double), intent(in) :: f_n(3, 3), ft(3, 3), state_n(*), properties(2)
    real(c_double), value :: dt
    real(c_double), intent(inout) :: energy, pt(3, 3), state(*)
    ! tangent(l, k, j, i) is the derivative of P_ij by F_kl.
    real(c_double), intent(inout) :: tangent(3, 3, 3, 3)
    character(kind=c_char), intent(inout) :: message(256)
    real(c_double) :: f(3, 3), e(3, 3), s(3, 3), b(3, 3), one(3, 3)
    integer :: i, j, k, l

    one = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 3])
    f = transpose(ft)
    b = matmul(f, ft)
    e = (matmul(ft, f) - one) / 2
    s = properties(1) * (e(1, 1) + e(2, 2) + e(3, 3)) * one + 2 * properties(2) * e
    energy = sum(s * e) / 2
    pt = transpose(matmul(f, s))
    do i = 1, 3
      do j = 1, 3
        do k = 1, 3
          do l = 1, 3
            tangent(l, k, j, i) = one(i, k) * s(l, j) + properties(1) * f(i, j) * f(k, l) &
              + properties(2) * (f(i, l) * f(k, j) + one(l, j) * b(i, k))
          end do
        end do
      end do
    end do
    saint_venant = 0
  end function saint_venant
end module saint_venant_law
